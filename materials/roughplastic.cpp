// Rough plastic: a diffuse base under a rough dielectric coating.

#include <array>

#include "materials/dielectric_lobe.h"
#include "materials/diffuse_base.h"
#include "materials/ior.h"
#include "materials/models.h"
#include "materials/rough_transmittance.h"
#include "materials/sampling.h"

namespace lobe {
namespace {

class RoughPlastic final : public Bsdf {
 public:
  RoughPlastic(LobePtr lobe, const RoughTransmittance& transmittance, DiffuseBase base, TexturePtr specular)
      : lobes_{std::move(lobe)},
        transmittance_(transmittance),
        base_(std::move(base)),
        specular_(std::move(specular)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return Rgb::Zero();
    return static_cast<float>(lobes_[0]->eval(wo, wi)) * specular_->eval(uv) +
           base_.colour(uv) * (transmittance_(wo.z()) * transmittance_(wi.z()) * kInvPi);
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (!(wo.z() > 0.0f)) return std::nullopt;
    const float glossy = glossyProbability(wo, uv);
    Vec3 wi;
    if (choice < glossy) {
      const std::optional<LobeSample> drawn = lobes_[0]->sample(wo, u);
      if (!drawn) return std::nullopt;
      wi = drawn->wi;
    } else {
      wi = squareToCosineHemisphere(u);
    }
    const float density = mixedPdf(wo, wi, glossy);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{wi, eval(wo, wi, uv), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    return wo.z() > 0.0f && wi.z() > 0.0f ? mixedPdf(wo, wi, glossyProbability(wo, uv)) : 0.0f;
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (!(wo.z() > 0.0f)) return result;
    result.glossy[0] = {0, luminance(specular_->eval(uv))};
    result.glossyCount = 1;
    result.constant = luminance(diffuseAlbedo(wo, uv));
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? Rgb(glossyAlbedo(wo, uv) + diffuseAlbedo(wo, uv)) : Rgb::Zero();
  }

 private:
  /// What is not let through; light lost between facets counts as reflected.
  Rgb glossyAlbedo(const Vec3& wo, const Vec2& uv) const {
    return (1.0f - transmittance_(wo.z())) * specular_->eval(uv);
  }
  Rgb diffuseAlbedo(const Vec3& wo, const Vec2& uv) const {
    return base_.colour(uv) * (transmittance_(wo.z()) * transmittance_.mean());
  }

  float glossyProbability(const Vec3& wo, const Vec2& uv) const {
    const float glossy = luminance(glossyAlbedo(wo, uv));
    const float diffuse = luminance(diffuseAlbedo(wo, uv));
    return glossy > 0.0f ? glossy / (glossy + diffuse) : 0.0f;
  }

  float mixedPdf(const Vec3& wo, const Vec3& wi, float glossy) const {
    return glossy * lobes_[0]->pdf(wo, wi) + (1.0f - glossy) * cosineHemispherePdf(wi);
  }

  std::array<LobePtr, 1> lobes_;
  RoughTransmittance transmittance_;
  DiffuseBase base_;
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makeRoughPlastic(const Parameters& parameters) {
  const Microfacet microfacet = Microfacet::read(parameters);
  if (microfacet.alphaU() != microfacet.alphaV())
    throw ParameterError("alpha_u", "roughplastic is isotropic: give alpha");
  const double eta = readRelativeIor(parameters, "polypropylene");
  const RoughTransmittance transmittance(microfacet, eta);
  DiffuseBase base{parameters.texture("diffuse_reflectance", grey(0.5f)), transmittance.internalReflectance(),
                   static_cast<float>(1.0 / (eta * eta)), parameters.flag("nonlinear", false)};
  return std::make_shared<RoughPlastic>(std::make_shared<DielectricLobe>(microfacet, eta), transmittance,
                                        std::move(base), parameters.texture("specular_reflectance", grey(1.0f)));
}

}  // namespace lobe
