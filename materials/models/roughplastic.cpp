// Rough plastic: a diffuse base under a rough dielectric coating.

#include "materials/ior.h"
#include "materials/lobes/dielectric_lobe.h"
#include "materials/lobes/diffuse_base.h"
#include "materials/lobes/rough_transmittance.h"
#include "materials/lobes/roughness.h"
#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

class RoughPlastic final : public Bsdf {
 public:
  RoughPlastic(Roughness roughness, double eta, DiffuseBase base, TexturePtr specular)
      : roughness_(std::move(roughness)),
        eta_(eta),
        transmittance_(roughness_, eta),
        base_(std::move(base)),
        specular_(std::move(specular)) {
    for (const Microfacet& level : roughness_.levels()) lobes_.push_back(std::make_shared<DielectricLobe>(level, eta));
  }

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return Rgb::Zero();
    const LocalRoughness roughness = roughness_.at(uv);
    double cosHalf = 0.0;
    const double facets = roughness.microfacet.reflection(wo, wi, &cosHalf);
    const double glossy = facets > 0.0 ? facets * fresnelDielectric(cosHalf, eta_).reflectance : 0.0;
    return static_cast<float>(glossy) * specular_->eval(uv) +
           baseColour(roughness, uv) * (transmittance_(roughness, wo.z()) * transmittance_(roughness, wi.z()) * kInvPi);
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (!(wo.z() > 0.0f)) return std::nullopt;
    const LocalRoughness roughness = roughness_.at(uv);
    std::optional<Vec3> wi = squareToCosineHemisphere(u);
    if (choice < glossyProbability(roughness, wo, uv)) wi = roughness.microfacet.sampleReflection(wo, u);
    if (!wi) return std::nullopt;
    const float density = pdf(wo, *wi, uv);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{*wi, eval(wo, *wi, uv), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0f;
    const LocalRoughness roughness = roughness_.at(uv);
    const float glossy = glossyProbability(roughness, wo, uv);
    return glossy * static_cast<float>(roughness.microfacet.reflectionPdf(wo, wi)) +
           (1.0f - glossy) * cosineHemispherePdf(wi);
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (!(wo.z() > 0.0f)) return result;
    const LocalRoughness roughness = roughness_.at(uv);
    addLevels(result, 0, roughness, luminance(specular_->eval(uv)));
    result.constant = luminance(diffuseAlbedo(roughness, wo, uv));
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f)) return Rgb::Zero();
    const LocalRoughness roughness = roughness_.at(uv);
    return glossyAlbedo(roughness, wo, uv) + diffuseAlbedo(roughness, wo, uv);
  }

 private:
  Rgb baseColour(const LocalRoughness& roughness, const Vec2& uv) const {
    return base_.colour(uv, transmittance_.internalReflectance(roughness));
  }
  /// Everything that is not transmitted; energy that single scattering loses between facets counts as reflected.
  Rgb glossyAlbedo(const LocalRoughness& roughness, const Vec3& wo, const Vec2& uv) const {
    return (1.0f - transmittance_(roughness, wo.z())) * specular_->eval(uv);
  }
  Rgb diffuseAlbedo(const LocalRoughness& roughness, const Vec3& wo, const Vec2& uv) const {
    return baseColour(roughness, uv) * (transmittance_(roughness, wo.z()) * transmittance_.mean(roughness));
  }

  float glossyProbability(const LocalRoughness& roughness, const Vec3& wo, const Vec2& uv) const {
    const float glossy = luminance(glossyAlbedo(roughness, wo, uv));
    const float diffuse = luminance(diffuseAlbedo(roughness, wo, uv));
    return glossy > 0.0f ? glossy / (glossy + diffuse) : 0.0f;
  }

  Roughness roughness_;
  double eta_;
  VaryingTransmittance transmittance_;
  std::vector<LobePtr> lobes_;  ///< one for each roughness level
  DiffuseBase base_;
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makeRoughPlastic(const Parameters& parameters) {
  Roughness roughness = Roughness::read(parameters);
  if (!roughness.isotropic())
    throw ParameterError("alpha_u", "roughplastic must be isotropic: give alpha instead of alpha_u and alpha_v");
  const double eta = readRelativeIor(parameters, "polypropylene");
  DiffuseBase base{readReflectance(parameters, {"diffuse_reflectance", grey(0.5f)}),
                   static_cast<float>(1.0 / (eta * eta)), parameters.flag("nonlinear", false)};
  return std::make_shared<RoughPlastic>(std::move(roughness), eta, std::move(base),
                                        readReflectance(parameters, {"specular_reflectance", grey(1.0f)}));
}

}  // namespace lobe
