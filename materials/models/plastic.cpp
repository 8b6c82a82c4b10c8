// Smooth plastic: a diffuse base under a smooth dielectric coating.

#include "materials/ior.h"
#include "materials/lobes/diffuse_base.h"
#include "materials/lobes/fresnel.h"
#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

class Plastic final : public Bsdf {
 public:
  Plastic(double eta, DiffuseBase base, TexturePtr specular)
      : eta_(eta),
        meanTransmittance_(static_cast<float>(1.0 - fresnelDiffuse(eta))),
        internalReflectance_(static_cast<float>(fresnelDiffuse(1.0 / eta))),
        base_(std::move(base)),
        specular_(std::move(specular)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return Rgb::Zero();
    return base_.colour(uv, internalReflectance_) * (transmittance(wo) * transmittance(wi) * kInvPi);
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float, const Vec2& u) const override {
    const Vec3 wi = squareToCosineHemisphere(u);
    const float density = pdf(wo, wi, uv);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{wi, eval(wo, wi, uv), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2&) const override {
    return wo.z() > 0.0f ? cosineHemispherePdf(wi) : 0.0f;
  }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float) const override {
    if (!(wo.z() > 0.0f)) return std::nullopt;
    return DeltaSample{Vec3(-wo.x(), -wo.y(), wo.z()), specularAlbedo(wo, uv), 1.0f};
  }

  float deltaProbability(const Vec3& wo, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f)) return 0.0f;
    const float specular = luminance(specularAlbedo(wo, uv));
    const float diffuse = luminance(diffuseAlbedo(wo, uv));
    return specular > 0.0f ? specular / (specular + diffuse) : 0.0f;
  }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (wo.z() > 0.0f) result.constant = luminance(diffuseAlbedo(wo, uv));
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? Rgb(specularAlbedo(wo, uv) + diffuseAlbedo(wo, uv)) : Rgb::Zero();
  }

 private:
  float transmittance(const Vec3& w) const {
    return static_cast<float>(1.0 - fresnelDielectric(w.z(), eta_).reflectance);
  }
  Rgb specularAlbedo(const Vec3& wo, const Vec2& uv) const {
    return static_cast<float>(fresnelDielectric(wo.z(), eta_).reflectance) * specular_->eval(uv);
  }
  Rgb diffuseAlbedo(const Vec3& wo, const Vec2& uv) const {
    return base_.colour(uv, internalReflectance_) * (transmittance(wo) * meanTransmittance_);
  }

  double eta_;
  float meanTransmittance_;  ///< of diffuse light from outside
  float internalReflectance_;
  DiffuseBase base_;
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makePlastic(const Parameters& parameters) {
  const double eta = readRelativeIor(parameters, "polypropylene");
  DiffuseBase base{readReflectance(parameters, {"diffuse_reflectance", grey(0.5f)}),
                   static_cast<float>(1.0 / (eta * eta)), parameters.flag("nonlinear", false)};
  return std::make_shared<Plastic>(eta, std::move(base),
                                   readReflectance(parameters, {"specular_reflectance", grey(1.0f)}));
}

}  // namespace lobe
