#include "runtime/mixture/product.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace lobe {
namespace {

/// (cos 2πu, sin 2πu) for u in [0,1), with an error below 2e-7. Without branches on u, which would be mispredicted.
Vec2 onCircle(float u) {
  const int quarter = static_cast<int>(4.0f * (u + 0.125f));
  const float t = 2.0f * std::numbers::pi_v<float> * (u - 0.25f * static_cast<float>(quarter)), t2 = t * t;
  // Taylor polynomials on |t| ≤ π/4.
  const float sine = t * (1.0f + t2 * (-1.0f / 6 + t2 * (1.0f / 120 + t2 * (-1.0f / 5040 + t2 * (1.0f / 362880)))));
  const float cosine = 1.0f + t2 * (-1.0f / 2 + t2 * (1.0f / 24 + t2 * (-1.0f / 720 + t2 * (1.0f / 40320))));
  const std::array<float, 2> axes{cosine, sine};
  const auto odd = static_cast<std::size_t>(quarter & 1);
  return {axes[odd] * static_cast<float>(1 - ((quarter + 1) & 2)),
          axes[1 - odd] * static_cast<float>(1 - (quarter & 2))};
}

/// Two independent samples of N(0, 1) (Box–Muller transform).
Vec2 standardNormal(const Vec2& u) {
  return std::sqrt(-2.0f * std::log(1.0f - u.x())) * onCircle(u.y());
}

/// A component by the parameters that a product needs; d is the variance of y for given x.
struct Factor {
  float x, y, slope, xx, d;
  Factor(const GaussiansView& mixture, int k) {
    const auto at = [&](GaussianField f) { return mixture.field(f)[k]; };
    x = at(GaussianField::x), y = at(GaussianField::y), slope = at(GaussianField::slope), xx = at(GaussianField::xx);
    d = at(GaussianField::conditional);
  }
  float ridge(float px) const { return y + slope * (px - x); }
};

/// Samples the normalised product of two components. With Cholesky factors, the product's density of x, and that of y
/// given x, are products of univariate Gaussians. All sums have positive terms, so that single precision suffices.
Vec2 samplePair(const Factor& one, const Factor& two, const Vec2& normal) {
  const float apart = two.x - one.x, bend = one.slope - two.slope, across = one.d + two.d;
  const float wide = one.xx * two.xx;
  const float determinant = (one.xx + two.xx) * across + wide * (bend * bend);
  const float gap = one.y - two.ridge(one.x);  // distance of the conditional means of y at one.x
  const float inverse = 1.0f / determinant;
  const float shift = (one.xx * across * apart - wide * bend * gap) * inverse;
  const float x = one.x + shift + std::sqrt(wide * across * inverse) * normal.x();
  const float fraction = one.d / across;
  const float ridge = one.ridge(x) + fraction * (two.ridge(x) - one.ridge(x));
  return {x, ridge + std::sqrt(fraction * two.d) * normal.y()};
}

}  // namespace

Vec2 sampleLane(const GaussiansView& mixture, int k, const Vec2& u) {
  const Factor g(mixture, k);
  const Vec2 normal = standardNormal(u);
  const float x = g.x + std::sqrt(g.xx) * normal.x();
  return {x, g.ridge(x) + std::sqrt(g.d) * normal.y()};
}

Vec2 sampleGaussians(const GaussiansView& mixture, float choice, const Vec2& u) {
  const float* weights = mixture.field(GaussianField::weight);
  float total = 0;
  for (int k = 0; k < mixture.count; ++k) total += weights[k];
  float left = choice * total;
  // If rounding leaves a remainder at the end, the last component with positive weight is chosen.
  int chosen = 0;
  for (int k = 0; k < mixture.count; ++k) {
    if (!(weights[k] > 0)) continue;
    chosen = k;
    if (left < weights[k]) break;
    left -= weights[k];
  }
  return sampleLane(mixture, chosen, u);
}

Product::Product(const GaussiansView& reflectance, float constant, const GaussiansView& light)
    : reflectance_(reflectance), light_(light), constant_(constant) {
  const float sum = pairMasses(reflectance, constant, light, pairs_.data(), columns_.data());
  // The comparison is false for NaN as well.
  mass_ = sum >= kMinMass && sum < std::numeric_limits<float>::infinity() ? sum : 0.0f;
}

Vec2 Product::sample(float choice, const Vec2& u) const {
  const PairIndex pair = choosePair(pairs_.data(), columns_.data(), reflectance_.count + 1, light_.stride, choice);
  if (pair.row == reflectance_.count) return sampleLane(light_, pair.column, u);
  return samplePair(Factor(reflectance_, pair.row), Factor(light_, pair.column), standardNormal(u));
}

float Product::pdf(const Vec2& y) const {
  const Densities at = densities(reflectance_, light_, y.x(), y.y());
  return (constant_ + at.reflectance) * (at.light / mass_);
}

}  // namespace lobe
