#include "runtime/mixture/em.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/mixture/eigenvalue_floor.h"

namespace lobe {

namespace {

constexpr double kLogTwoPi = 1.8378770664093454836;

// A component made ready for the E step, and what the M step needs of it.
struct Component {
  double logScale;  // log of weight / (2π sqrt|Σ|)
  double x, y, slope, invAlong, invAcross;
  double mass = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;

  explicit Component(const Gaussian& g)
      : x(g.meanX),
        y(g.meanY),
        slope(static_cast<double>(g.cov.xy) / g.cov.xx),
        invAlong(1 / static_cast<double>(g.cov.xx)) {
    const double across = g.cov.yy - slope * g.cov.xy;
    invAcross = 1 / across;
    logScale = std::log(static_cast<double>(g.weight)) - kLogTwoPi - 0.5 * std::log(g.cov.xx * across);
  }
  double logDensity(double px, double py) const {
    const double dx = px - x, across = py - y - slope * dx;
    return logScale - 0.5 * (dx * dx * invAlong + across * across * invAcross);
  }
  // Moments about the present mean, so that narrow lobes lose no digits.
  void add(double weight, double px, double py) {
    const double dx = px - x, dy = py - y;
    mass += weight;
    sx += weight * dx, sy += weight * dy;
    sxx += weight * dx * dx, sxy += weight * dx * dy, syy += weight * dy * dy;
  }
};

// Adds a point to all components by its responsibilities; returns the log of the mixture's density there. Relative to
// the largest term, so that points far from every component still count.
double expectation(const WeightedPoint& point, std::vector<Component>& components, std::vector<double>& share) {
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < components.size(); ++k) {
    share[k] = components[k].logDensity(point.y.x(), point.y.y());
    largest = std::max(largest, share[k]);
  }
  double sum = 0;
  for (double& s : share) sum += s = std::exp(s - largest);
  const double scale = point.weight / sum;
  for (std::size_t k = 0; k < components.size(); ++k)
    if (share[k] > 0) components[k].add(scale * share[k], point.y.x(), point.y.y());
  return largest + std::log(sum);
}

// A component that no point belongs to keeps its shape and loses its weight.
void maximisation(const Component& c, double totalWeight, double minVariance, Gaussian& g) {
  g.weight = static_cast<float>(c.mass / totalWeight);
  if (!(c.mass > 0)) return;
  const double dx = c.sx / c.mass, dy = c.sy / c.mass;
  g.meanX = static_cast<float>(c.x + dx);
  g.meanY = static_cast<float>(c.y + dy);
  g.cov =
      withEigenvalueFloor(c.sxx / c.mass - dx * dx, c.sxy / c.mass - dx * dy, c.syy / c.mass - dy * dy, minVariance);
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
  std::vector<Component> components;
  components.reserve(mixture.size());
  std::vector<double> share(mixture.size());
  double previous = -std::numeric_limits<double>::infinity();
  for (int sweep = 1; sweep <= options.maxSweeps; ++sweep) {
    components.clear();
    for (const Gaussian& g : mixture) components.emplace_back(g);
    double likelihood = 0;
    for (const WeightedPoint& p : points)
      if (p.weight > 0) likelihood += p.weight * expectation(p, components, share);
    likelihood /= totalWeight;
    for (std::size_t k = 0; k < mixture.size(); ++k)
      maximisation(components[k], totalWeight, options.minVariance, mixture[k]);
    if (std::abs(likelihood - previous) <= options.tolerance * std::abs(likelihood)) return sweep;
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
