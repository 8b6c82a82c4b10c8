#include "materials/adapters/coated_base.h"

#include <algorithm>
#include <cmath>

#include "materials/lobes/fresnel.h"

namespace lobe {
namespace {

/// Refracts w by Snell's law, with eta the index of the far side over that of the near side; the result stays on the
/// side of w. nullopt: total internal reflection, or w is in the surface plane.
std::optional<Vec3> bent(const Vec3& w, double eta) {
  const DielectricFresnel fresnel = fresnelDielectric(std::abs(w.z()), eta);
  if (!(fresnel.cosTransmitted > 0.0) || w.z() == 0.0f) return std::nullopt;
  return Eigen::Vector3d(w.x() / eta, w.y() / eta, std::copysign(fresnel.cosTransmitted, w.z()))
      .normalized()
      .cast<float>();
}

}  // namespace

CoatedBase::CoatedBase(BsdfPtr nested, double eta, TexturePtr depth)
    : nested_(std::move(nested)),
      eta_(eta),
      inverseEta2_(static_cast<float>(1.0 / (eta * eta))),
      depth_(std::move(depth)) {
  const double count = static_cast<double>(diffuseRays_.size());
  for (std::size_t i = 0; i < diffuseRays_.size(); ++i) {
    const double cosine = std::sqrt((static_cast<double>(i) + 0.5) / count);
    const double inside = std::max(1e-6, fresnelDielectric(cosine, eta).cosTransmitted);
    diffuseRays_[i] = {static_cast<float>(cosine), static_cast<float>(inside)};
  }
}

std::optional<Vec3> CoatedBase::bentInwards(const Vec3& w) const {
  return bent(w, eta_);
}

std::optional<Vec3> CoatedBase::bentOutwards(const Vec3& w) const {
  return bent(w, 1.0 / eta_);
}

Rgb CoatedBase::absorption(const Vec3& oInside, const Vec3& iInside, const Vec2& uv) const {
  return (-depth_->eval(uv) * (1.0f / std::abs(oInside.z()) + 1.0f / std::abs(iInside.z()))).exp();
}

// Refraction scales solid angles by dω'/dω = cosθ / (η² cosθ'), where the primed quantities are inside the layer.
Rgb CoatedBase::eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const {
  const std::optional<Vec3> o = bentInwards(wo);
  const std::optional<Vec3> i = bentInwards(wi);
  if (!o || !i) return Rgb::Zero();
  return nested_->eval(*o, *i, uv) * absorption(*o, *i, uv) * inverseEta2_;
}

float CoatedBase::pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const {
  const std::optional<Vec3> o = bentInwards(wo);
  const std::optional<Vec3> i = bentInwards(wi);
  if (!o || !i) return 0.0f;
  return nested_->pdf(*o, *i, uv) * inverseEta2_ * (wi.z() / i->z());
}

std::optional<BsdfSample> CoatedBase::sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const {
  const std::optional<Vec3> o = bentInwards(wo);
  if (!o) return std::nullopt;
  const std::optional<BsdfSample> inside = nested_->sample(*o, uv, choice, u);
  const std::optional<Vec3> wi = inside ? bentOutwards(inside->wi) : std::nullopt;
  if (!wi) return std::nullopt;
  return BsdfSample{*wi, eval(wo, *wi, uv), pdf(wo, *wi, uv), inside->eta};
}

std::optional<DeltaSample> CoatedBase::sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const {
  const std::optional<Vec3> o = bentInwards(wo);
  if (!o) return std::nullopt;
  const std::optional<DeltaSample> inside = nested_->sampleDelta(*o, uv, choice);
  const std::optional<Vec3> wi = inside ? bentOutwards(inside->wi) : std::nullopt;
  if (!wi) return std::nullopt;
  return DeltaSample{*wi, inside->weight * absorption(*o, inside->wi, uv), inside->eta, inside->probability,
                     inside->component};
}

// The probability of the nested sampler's delta part approximates the fraction of the delta part in the albedo.
CoatedBase::Albedo CoatedBase::nestedAlbedo(const Vec3& inside, const Vec2& uv) const {
  const Rgb all = nested_->albedo(inside, uv);
  const float bright = luminance(all);
  if (!(bright > 0.0f)) return {};
  const float delta = nested_->deltaProbability(inside, uv);
  const float constant = std::min(1.0f - delta, nested_->mixture(inside, uv).constant / bright);
  return {all * constant, all * (1.0f - delta - constant), all * delta};
}

}  // namespace lobe
