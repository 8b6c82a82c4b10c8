#include "runtime/mixture/product.h"

#include <limits>
#include <numeric>
#include <stdexcept>

#include "runtime/mixture/normal_kernel.h"

namespace lobe {

namespace {

// Σ1 S⁻¹ as a full matrix, S = Σ1 + Σ2. In double: it is done once a sample, and it keeps Σ1 S⁻¹ Σ2 positive definite.
struct Gain {
  double a, b, c, d;
};

Gain gain(const Covariance& one, const Covariance& two) {
  const double sxx = static_cast<double>(one.xx) + two.xx, sxy = static_cast<double>(one.xy) + two.xy,
               syy = static_cast<double>(one.yy) + two.yy;
  const double inverse = 1 / (sxx * syy - sxy * sxy);
  return {(one.xx * syy - one.xy * sxy) * inverse, (one.xy * sxx - one.xx * sxy) * inverse,
          (one.xy * syy - one.yy * sxy) * inverse, (one.yy * sxx - one.xy * sxy) * inverse};
}

// The normalised product of two components: μ = Σ1 S⁻¹ μ2 + Σ2 S⁻¹ μ1 = μ1 + Σ1 S⁻¹ (μ2 − μ1) and Σ = Σ1 S⁻¹ Σ2.
Gaussian pairProduct(const Gaussian& one, const Gaussian& two) {
  const Gain k = gain(one.cov, two.cov);
  const double dx = static_cast<double>(two.meanX) - one.meanX, dy = static_cast<double>(two.meanY) - one.meanY;
  return {1.0f, static_cast<float>(one.meanX + k.a * dx + k.b * dy),
          static_cast<float>(one.meanY + k.c * dx + k.d * dy),
          Covariance{static_cast<float>(k.a * two.cov.xx + k.b * two.cov.xy),
                     static_cast<float>(k.a * two.cov.xy + k.b * two.cov.yy),
                     static_cast<float>(k.c * two.cov.xy + k.d * two.cov.yy)}};
}

// The illumination's components side by side, so that the loop over them vectorises.
struct Columns {
  std::array<float, kMaxIlluminationComponents> weight, x, y, xx, xy, yy;
  explicit Columns(std::span<const Gaussian> mixture) {
    for (std::size_t j = 0; j < mixture.size(); ++j) {
      const Gaussian& g = mixture[j];
      weight[j] = g.weight, x[j] = g.meanX, y[j] = g.meanY, xx[j] = g.cov.xx, xy[j] = g.cov.xy, yy[j] = g.cov.yy;
    }
  }
};

// a b_j N(μ − μ_j | 0, Σ + Σ_j) for all j.
void pairWeights(const Gaussian& one, const Columns& two, std::size_t count, float* pairs) {
  const Gaussian g = one;  // a copy: `pairs` might alias the original
  for (std::size_t j = 0; j < count; ++j) {
    const Covariance sum{g.cov.xx + two.xx[j], g.cov.xy + two.xy[j], g.cov.yy + two.yy[j]};
    pairs[j] = g.weight * two.weight[j] * centredNormal(g.meanX - two.x[j], g.meanY - two.y[j], sum);
  }
}

}  // namespace

Product::Product(std::span<const Gaussian> reflectance, float constant, std::span<const Gaussian> illumination)
    : reflectance_(reflectance), illumination_(illumination), constant_(constant) {
  if (reflectance.size() > kMaxReflectanceComponents || illumination.size() > kMaxIlluminationComponents)
    throw std::runtime_error("a product's factor has too many components");
  const std::size_t stride = illumination.size();
  const Columns columns(illumination);
  for (std::size_t i = 0; i < reflectance.size(); ++i)
    pairWeights(reflectance[i], columns, stride, &pairs_[i * stride]);
  for (std::size_t j = 0; j < stride; ++j) pairs_[reflectance.size() * stride + j] = constant * illumination[j].weight;
  const float sum = std::accumulate(pairs_.begin(), pairs_.begin() + (reflectance.size() + 1) * stride, 0.0f);
  // The comparison is false for NaN as well.
  mass_ = sum >= kMinMass && sum < std::numeric_limits<float>::infinity() ? sum : 0.0f;
}

Vec2 Product::sample(float choice, const Vec2& u) const {
  const std::size_t stride = illumination_.size(), count = (reflectance_.size() + 1) * stride;
  float left = choice * mass_;
  // Rounding may leave a little at the end: then the last pair that has weight is taken.
  std::size_t chosen = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (pairs_[k] <= 0) continue;
    chosen = k;
    if (left < pairs_[k]) break;
    left -= pairs_[k];
  }
  const Gaussian& two = illumination_[chosen % stride];
  if (chosen / stride == reflectance_.size()) return sampleNormal(two, u);
  return sampleNormal(pairProduct(reflectance_[chosen / stride], two), u);
}

float Product::pdf(const Vec2& y) const {
  return (constant_ + mixturePdf(reflectance_, y)) * (mixturePdf(illumination_, y) / mass_);
}

}  // namespace lobe
