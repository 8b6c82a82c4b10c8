#include "runtime/mixture/gaussian.h"

#include <limits>
#include <numbers>
#include <utility>

#include "runtime/mixture/normal_kernel.h"

namespace lobe {

namespace {

// In double precision, because merge costs are small differences of large terms.
double logDeterminant(const Covariance& c) {
  return std::log(static_cast<double>(c.xx) * c.yy - static_cast<double>(c.xy) * c.xy);
}

// A merged component in double precision, so that its cost is not affected by rounding the covariance to floats.
struct Moments {
  double weight, x, y, xx, xy, yy;
};

Moments mergedMoments(const Gaussian& a, const Gaussian& b) {
  const double weight = static_cast<double>(a.weight) + b.weight;
  // Two components of zero weight are merged at their midpoint.
  const double ta = weight > 0 ? a.weight / weight : 0.5, tb = 1 - ta;
  const double dx = static_cast<double>(a.meanX) - b.meanX, dy = static_cast<double>(a.meanY) - b.meanY;
  return {weight,
          ta * a.meanX + tb * b.meanX,
          ta * a.meanY + tb * b.meanY,
          ta * a.cov.xx + tb * b.cov.xx + ta * tb * dx * dx,
          ta * a.cov.xy + tb * b.cov.xy + ta * tb * dx * dy,
          ta * a.cov.yy + tb * b.cov.yy + ta * tb * dy * dy};
}

}  // namespace

float normalPdf(const Gaussian& g, const Vec2& y) {
  return centredNormal(y.x() - g.meanX, y.y() - g.meanY, g.cov);
}

float mixturePdf(std::span<const Gaussian> mixture, const Vec2& y) {
  float sum = 0;
  for (const Gaussian& g : mixture) sum += g.weight * normalPdf(g, y);
  return sum;
}

Vec2 sampleNormal(const Gaussian& g, const Vec2& u) {
  const float radius = std::sqrt(-2.0f * std::log1p(-u.x()));
  const float angle = 2.0f * std::numbers::pi_v<float> * u.y();
  const float z1 = radius * std::cos(angle), z2 = radius * std::sin(angle);
  const float l11 = std::sqrt(g.cov.xx);
  const float l22 = std::sqrt(g.cov.determinant() / g.cov.xx);
  return {g.meanX + l11 * z1, g.meanY + g.cov.xy / l11 * z1 + l22 * z2};
}

Vec2 sampleMixture(std::span<const Gaussian> mixture, float choice, const Vec2& u) {
  float total = 0;
  for (const Gaussian& g : mixture) total += g.weight;
  float left = choice * total;
  // If rounding leaves a remainder at the end, the last component with positive weight is chosen.
  std::size_t chosen = 0;
  for (std::size_t k = 0; k < mixture.size(); ++k) {
    if (mixture[k].weight <= 0) continue;
    chosen = k;
    if (left < mixture[k].weight) break;
    left -= mixture[k].weight;
  }
  return sampleNormal(mixture[chosen], u);
}

Gaussian rotated(const Gaussian& g, const Vec2& direction) {
  const float c = direction.x(), s = direction.y();
  const Covariance& v = g.cov;
  return {g.weight, c * g.meanX - s * g.meanY, s * g.meanX + c * g.meanY,
          Covariance{c * c * v.xx - 2 * c * s * v.xy + s * s * v.yy, c * s * (v.xx - v.yy) + (c * c - s * s) * v.xy,
                     s * s * v.xx + 2 * c * s * v.xy + c * c * v.yy}};
}

Gaussian merged(const Gaussian& a, const Gaussian& b) {
  const Moments m = mergedMoments(a, b);
  return {static_cast<float>(m.weight), static_cast<float>(m.x), static_cast<float>(m.y),
          Covariance{static_cast<float>(m.xx), static_cast<float>(m.xy), static_cast<float>(m.yy)}};
}

float mergeCost(const Gaussian& a, const Gaussian& b) {
  const Moments m = mergedMoments(a, b);
  if (m.weight <= 0) return 0;
  const double cost = 0.5 * (m.weight * std::log(m.xx * m.yy - m.xy * m.xy) - a.weight * logDeterminant(a.cov) -
                             b.weight * logDeterminant(b.cov));
  // The cost is a relative entropy, which only rounding can make negative.
  return static_cast<float>(std::max(0.0, cost));
}

float reduce(Mixture& mixture, float threshold) {
  float spent = 0;
  while (mixture.size() > 1) {
    float cheapest = std::numeric_limits<float>::infinity();
    std::pair<std::size_t, std::size_t> pair{0, 1};
    for (std::size_t i = 0; i < mixture.size(); ++i) {
      for (std::size_t j = i + 1; j < mixture.size(); ++j) {
        const float cost = mergeCost(mixture[i], mixture[j]);
        if (cost < cheapest) cheapest = cost, pair = {i, j};
      }
    }
    if (!(spent + cheapest <= threshold)) break;
    spent += cheapest;
    mixture[pair.first] = merged(mixture[pair.first], mixture[pair.second]);
    mixture.erase(mixture.begin() + static_cast<std::ptrdiff_t>(pair.second));
  }
  return spent;
}

}  // namespace lobe
