// A smooth, absorbing dielectric coating over another model. Light that the coating reflects internally is lost, as in
// Mitsuba 0.6.

#include "materials/adapters/coated_base.h"
#include "materials/adapters/coating_parameters.h"
#include "materials/lobes/fresnel.h"
#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

class Coating final : public CoatedBsdf {
 public:
  Coating(BsdfPtr nested, double eta, TexturePtr depth, TexturePtr specular)
      : CoatedBsdf(CoatedBase(std::move(nested), eta, std::move(depth))), eta_(eta), specular_(std::move(specular)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    return base().eval(wo, wi, uv) * (transmittance(std::abs(wo.z())) * transmittance(std::abs(wi.z())));
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    std::optional<BsdfSample> result = base().sample(wo, uv, choice, u);
    if (!result || !(result->pdf > 0.0f)) return std::nullopt;
    result->f *= transmittance(std::abs(wo.z())) * transmittance(std::abs(result->wi.z()));
    return result;
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override { return base().pdf(wo, wi, uv); }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const override {
    const Rgb mirrored = specularAlbedo(wo, uv);
    const float specular = luminance(mirrored);
    const float nested = luminance(nestedAlbedo(wo, uv).delta);
    if (!(specular + nested > 0.0f) || wo.z() == 0.0f) return std::nullopt;
    const float p = specular / (specular + nested);
    if (choice < p) return DeltaSample{Vec3(-wo.x(), -wo.y(), wo.z()), mirrored / p, 1.0f, p};
    std::optional<DeltaSample> result = base().sampleDelta(wo, uv, rescaledAbove(p, choice));
    if (!result) return std::nullopt;
    result->weight *= transmittance(std::abs(wo.z())) * transmittance(std::abs(result->wi.z())) / (1.0f - p);
    result->probability *= 1.0f - p;
    result->component = 0.5 * (1.0 + result->component);
    return result;
  }

  float deltaProbability(const Vec3& wo, const Vec2& uv) const override {
    const CoatedBase::Albedo nested = nestedAlbedo(wo, uv);
    const float smooth = luminance(nested.constant + nested.directional);
    const float delta = luminance(specularAlbedo(wo, uv) + nested.delta);
    return delta > 0.0f ? delta / (smooth + delta) : 0.0f;
  }

  /// Refraction changes the nested model's lobes, so they are not described here but left to its sampler.
  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    const CoatedBase::Albedo nested = nestedAlbedo(wo, uv);
    LobeMixture result;
    result.constant = luminance(nested.constant);
    const float undescribed = luminance(nested.directional);
    if (undescribed > 0.0f) result.undescribedFraction = undescribed / (undescribed + result.constant);
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return specularAlbedo(wo, uv) + nestedAlbedo(wo, uv).sum();
  }

 private:
  float transmittance(float cosine) const {
    return static_cast<float>(1.0 - fresnelDielectric(cosine, eta_).reflectance);
  }
  Rgb specularAlbedo(const Vec3& wo, const Vec2& uv) const {
    return (1.0f - transmittance(std::abs(wo.z()))) * specular_->eval(uv);
  }
  CoatedBase::Albedo nestedAlbedo(const Vec3& wo, const Vec2& uv) const {
    return base().albedo(wo, uv, [this](float cosine) { return transmittance(cosine); });
  }

  double eta_;
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makeCoating(const Parameters& parameters) {
  const CoatingParameters p = readCoating(parameters);
  return std::make_shared<Coating>(p.nested, p.eta, p.depth, p.specular);
}

}  // namespace lobe
