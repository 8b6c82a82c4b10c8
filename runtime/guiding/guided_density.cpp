#include "runtime/guiding/guided_density.h"

#include <algorithm>
#include <numbers>

namespace lobe {
namespace {

constexpr float kTwoOverPi = 2.0f * std::numbers::inv_pi_v<float>;

/// A cosine-weighted direction is uniform in the disc of its xy (Malley's method).
Vec3 sampleCosine(const Vec2& u) {
  const float r = std::sqrt(u.x());
  const float phi = 2.0f * std::numbers::pi_v<float> * u.y();
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0f, 1.0f - u.x()))};
}

}  // namespace

GuidedDensity::GuidedDensity(const Reflectance& reflectance, const PackedRecord& illumination,
                             const StrategyProbabilities& probabilities)
    : reflectance_(reflectance),
      illumination_(illumination),
      bsdfFraction_(probabilities.bsdf + probabilities.product),
      illuminationFraction_(probabilities.illumination) {
  if (probabilities.product <= 0) return;
  product_.emplace(reflectance.gaussians.view(), reflectance.constant, illumination.gaussians());
  const float background = illumination.background * reflectance.backgroundMass;
  const float gaussian = (1.0f - illumination.background) * product_->mass();
  reflected_ = background + gaussian;
  const float fraction = probabilities.product * gaussian / reflected_;
  if (!(fraction > 0 && product_->mass() > 0)) return;
  productFraction_ = std::min(fraction, probabilities.product);
  productScale_ = productFraction_ / product_->mass();
  bsdfFraction_ -= productFraction_;
}

std::optional<Vec3> GuidedDensity::sample(Strategy strategy, float choice, const Vec2& u) const {
  Vec2 y;
  if (strategy == Strategy::product) {
    y = product_->sample(choice, u);
  } else {
    if (detail::chooseFirst(choice, illumination_.background)) return sampleCosine(u);
    y = sampleGaussians(illumination_.gaussians(), choice, u);
  }
  if (!insideDisc(y)) return std::nullopt;
  return fromDisc(y);
}

float GuidedDensity::guidedPdf(const Vec3& wi) const {
  if (wi.z() <= 0) return 0;
  const Vec2 y = toDisc(wi);
  const float background = illumination_.background * kTwoOverPi * wi.z();
  Densities at{0, 0};
  if (productScale_ > 0)
    at = densities(reflectance_.gaussians.view(), illumination_.gaussians(), y.x(), y.y());
  else
    at.light = lightDensity(illumination_.gaussians(), y.x(), y.y());
  // The product's density is G1(y) G2(y) / Z.
  return 0.5f * (illuminationFraction_ * (background + (1.0f - illumination_.background) * at.light) +
                 productScale_ * (reflectance_.constant + at.reflectance) * at.light);  // dω = 2 dA
}

}  // namespace lobe
