#include "runtime/mixture/em.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

#include "runtime/mixture/eigenvalue_floor.h"
#include "runtime/mixture/fast_exp.h"

namespace lobe {

namespace {

constexpr double kLogTwoPi = 1.8378770664093454836;

constexpr std::size_t kLanes = 8;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Eight components as a structure of arrays, so that the loops over them vectorise: precomputed terms for the E step
// and sums for the M step. Padding lanes have zero weight and therefore zero responsibility.
struct Block {
  using Lane = std::array<double, kLanes>;
  Lane logScale;  // log of weight / (2π sqrt|Σ|)
  Lane x{}, y{}, slope{}, along{}, across{};
  Lane mass{}, sx{}, sy{}, sxx{}, sxy{}, syy{};  // moments about the current mean, which avoids cancellation
  Lane log{};                                    // log densities at the current point
  std::array<float, kLanes> responsibility{};

  Block() { logScale.fill(-kInfinity); }
  void set(std::size_t k, const Gaussian& g);
  double logDensities(double px, double py);
  double responsibilities(double largest);
  void add(double px, double py, double scale);
  void maximise(std::size_t k, double totalWeight, double minVariance, Gaussian& g) const;
};

void Block::set(std::size_t k, const Gaussian& g) {
  const double xx = g.cov.xx, ratio = g.cov.xy / xx, rest = g.cov.yy - ratio * g.cov.xy;
  x[k] = g.meanX;
  y[k] = g.meanY;
  slope[k] = ratio;
  along[k] = -0.5 / xx;
  across[k] = -0.5 / rest;
  logScale[k] = std::log(static_cast<double>(g.weight)) - kLogTwoPi - 0.5 * std::log(xx * rest);
}

// Computes the log densities at a point; returns the largest.
double Block::logDensities(double px, double py) {
  for (std::size_t k = 0; k < kLanes; ++k) {
    const double dx = px - x[k], dy = py - y[k] - slope[k] * dx;
    log[k] = logScale[k] + dx * dx * along[k] + dy * dy * across[k];
  }
  return *std::max_element(log.begin(), log.end());
}

// Computes the densities relative to exp(largest); returns their sum.
double Block::responsibilities(double largest) {
  for (std::size_t k = 0; k < kLanes; ++k) responsibility[k] = expNegative(static_cast<float>(log[k] - largest));
  return std::accumulate(responsibility.begin(), responsibility.end(), 0.0);
}

void Block::add(double px, double py, double scale) {
  for (std::size_t k = 0; k < kLanes; ++k) {
    const double q = scale * responsibility[k], dx = px - x[k], dy = py - y[k];
    mass[k] += q;
    sx[k] += q * dx;
    sy[k] += q * dy;
    sxx[k] += q * dx * dx;
    sxy[k] += q * dx * dy;
    syy[k] += q * dy * dy;
  }
}

// A component without responsibility for any point keeps its mean and covariance; its weight becomes zero.
void Block::maximise(std::size_t k, double totalWeight, double minVariance, Gaussian& g) const {
  g.weight = static_cast<float>(mass[k] / totalWeight);
  if (!(mass[k] > 0)) return;
  const double dx = sx[k] / mass[k], dy = sy[k] / mass[k];
  g.meanX = static_cast<float>(x[k] + dx);
  g.meanY = static_cast<float>(y[k] + dy);
  g.cov = withEigenvalueFloor(sxx[k] / mass[k] - dx * dx, sxy[k] / mass[k] - dx * dy, syy[k] / mass[k] - dy * dy,
                              minVariance);
}

// Adds a point to the sums of all components; returns the log of the mixture's density there. The densities are
// computed relative to the largest, so that they do not underflow at points far from every component.
double expectation(const WeightedPoint& point, std::vector<Block>& blocks) {
  double largest = -kInfinity, sum = 0;
  for (Block& b : blocks) largest = std::max(largest, b.logDensities(point.y.x(), point.y.y()));
  for (Block& b : blocks) sum += b.responsibilities(largest);
  for (Block& b : blocks) b.add(point.y.x(), point.y.y(), point.weight / sum);
  return largest + std::log(sum);
}

// Performs one EM iteration; returns the mean log-likelihood before it.
double sweep(std::span<const WeightedPoint> points, double totalWeight, double minVariance, Mixture& mixture,
             std::vector<Block>& blocks) {
  blocks.assign(blocks.size(), Block());
  for (std::size_t k = 0; k < mixture.size(); ++k) blocks[k / kLanes].set(k % kLanes, mixture[k]);
  double likelihood = 0;
  for (const WeightedPoint& p : points)
    if (p.weight > 0) likelihood += p.weight * expectation(p, blocks);
  for (std::size_t k = 0; k < mixture.size(); ++k)
    blocks[k / kLanes].maximise(k % kLanes, totalWeight, minVariance, mixture[k]);
  return likelihood / totalWeight;
}

double positiveWeight(std::span<const WeightedPoint> points) {
  double sum = 0;
  for (const WeightedPoint& p : points)
    if (p.weight > 0) sum += p.weight;
  return sum;
}

void normalise(Mixture& mixture) {
  double sum = 0;
  for (const Gaussian& g : mixture) sum += g.weight;
  const auto count = static_cast<float>(mixture.size());
  for (Gaussian& g : mixture) g.weight = sum > 0 ? static_cast<float>(g.weight / sum) : 1 / count;
}

}  // namespace

int weightedEm(std::span<const WeightedPoint> points, Mixture& mixture, const WeightedEmOptions& options) {
  const double totalWeight = positiveWeight(points);
  if (mixture.empty() || !(totalWeight > 0)) return 0;
  normalise(mixture);
  std::vector<Block> blocks((mixture.size() + kLanes - 1) / kLanes);
  double previous = -kInfinity;
  for (int i = 1; i <= options.maxSweeps; ++i) {
    const double likelihood = sweep(points, totalWeight, options.minVariance, mixture, blocks);
    if (std::abs(likelihood - previous) <= options.tolerance * std::abs(likelihood)) return i;
    previous = likelihood;
  }
  return options.maxSweeps;
}

double meanLogLikelihood(std::span<const WeightedPoint> points, std::span<const Gaussian> mixture, float background) {
  double sum = 0;
  for (const WeightedPoint& p : points) {
    if (!(p.weight > 0)) continue;
    const double flat = 2 * std::numbers::inv_pi * background * discCosine(p.y);
    sum += p.weight * std::log(flat + (1.0 - background) * mixturePdf(mixture, p.y));
  }
  return sum / positiveWeight(points);
}

}  // namespace lobe
