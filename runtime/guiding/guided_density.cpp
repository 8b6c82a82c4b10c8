#include "runtime/guiding/guided_density.h"

#include <algorithm>
#include <numbers>

namespace lobe {
namespace {

constexpr float kTwoOverPi = 2.0f * std::numbers::inv_pi_v<float>;

/// Splits [0,1) at share and stretches the part that choice falls in back to [0,1).
bool take(float& choice, float share) {
  if (choice < share) {
    choice = std::min(choice / share, 0x1.fffffep-1f);
    return true;
  }
  choice = share < 1 ? std::min((choice - share) / (1 - share), 0x1.fffffep-1f) : 0;
  return false;
}

/// A cosine-weighted direction is uniform in the disc of its xy (Malley's method).
Vec3 sampleCosine(const Vec2& u) {
  const float r = std::sqrt(u.x());
  const float phi = 2.0f * std::numbers::pi_v<float> * u.y();
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0f, 1.0f - u.x()))};
}

}  // namespace

GuidedDensity::GuidedDensity(const Reflectance& reflectance, const PackedRecord& illumination,
                             const StrategyShares& shares)
    : reflectance_(reflectance),
      illumination_(illumination),
      bsdfShare_(shares.bsdf + shares.product),
      illuminationShare_(shares.illumination) {
  if (shares.product <= 0) return;
  product_.emplace(reflectance.gaussians.view(), reflectance.constant, illumination.lanes());
  const float background = illumination.background * reflectance.backgroundMass;
  const float gaussian = (1.0f - illumination.background) * product_->mass();
  reflected_ = background + gaussian;
  const float share = shares.product * gaussian / reflected_;
  if (!(share > 0 && product_->mass() > 0)) return;
  productShare_ = std::min(share, shares.product);
  productScale_ = productShare_ / product_->mass();
  bsdfShare_ -= productShare_;
}

Strategy GuidedDensity::choose(float& choice) const {
  if (take(choice, bsdfShare_)) return Strategy::bsdf;
  const float guided = productShare_ + illuminationShare_;
  return take(choice, guided > 0 ? productShare_ / guided : 0) ? Strategy::product : Strategy::illumination;
}

std::optional<Vec3> GuidedDensity::sample(Strategy strategy, float choice, const Vec2& u) const {
  Vec2 y;
  if (strategy == Strategy::product) {
    y = product_->sample(choice, u);
  } else {
    if (take(choice, illumination_.background)) return sampleCosine(u);
    y = sampleLanes(illumination_.lanes(), choice, u);
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
    at = densities(reflectance_.gaussians.view(), illumination_.lanes(), y.x(), y.y());
  else
    at.light = lightDensity(illumination_.lanes(), y.x(), y.y());
  // The product's density is G1(y) G2(y) / Z.
  return 0.5f * (illuminationShare_ * (background + (1.0f - illumination_.background) * at.light) +
                 productScale_ * (reflectance_.constant + at.reflectance) * at.light);  // dω = 2 dA
}

}  // namespace lobe
