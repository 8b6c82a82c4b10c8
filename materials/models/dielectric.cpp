// A smooth interface between two dielectrics: reflects and refracts.

#include <cmath>

#include "materials/ior.h"
#include "materials/lobes/fresnel.h"
#include "materials/models.h"
#include "materials/reflectance.h"

namespace lobe {
namespace {

class Dielectric final : public Bsdf {
 public:
  Dielectric(double eta, TexturePtr reflectance, TexturePtr transmittance)
      : eta_(eta), reflectance_(std::move(reflectance)), transmittance_(std::move(transmittance)) {}

  Rgb eval(const Vec3&, const Vec3&, const Vec2&) const override { return Rgb::Zero(); }
  std::optional<BsdfSample> sample(const Vec3&, const Vec2&, float, const Vec2&) const override { return std::nullopt; }
  float pdf(const Vec3&, const Vec3&, const Vec2&) const override { return 0.0f; }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const override {
    const double eta = wo.z() > 0.0f ? eta_ : 1.0 / eta_;  // far side over the side of wo
    const DielectricFresnel fresnel = fresnelDielectric(std::abs(wo.z()), eta);
    const Rgb reflected = static_cast<float>(fresnel.reflectance) * reflectance_->eval(uv);
    const Rgb refracted = static_cast<float>(1.0 - fresnel.reflectance) * transmittance_->eval(uv);
    const float total = luminance(reflected) + luminance(refracted);
    if (!(total > 0.0f) || wo.z() == 0.0f) return std::nullopt;
    const float p = luminance(reflected) / total;
    if (choice < p) return DeltaSample{Vec3(-wo.x(), -wo.y(), wo.z()), reflected / p, 1.0f, p};
    const float e = static_cast<float>(eta);
    // Refraction compresses solid angles in the denser medium, so that L/n² is conserved and not L.
    return DeltaSample{refractedDirection(wo, fresnel, e), refracted / ((1.0f - p) * e * e), e, 1.0f - p, 0.5};
  }
  std::optional<DeltaTransmission> deltaTransmission(const Vec3& wo, const Vec2& uv) const override {
    const double eta = wo.z() > 0.0f ? eta_ : 1.0 / eta_;
    const DielectricFresnel fresnel = fresnelDielectric(std::abs(wo.z()), eta);
    const float passed = static_cast<float>(1.0 - fresnel.reflectance);
    if (!(passed > 0.0f) || wo.z() == 0.0f) return std::nullopt;  // total internal reflection
    const float e = static_cast<float>(eta);
    return DeltaTransmission{refractedDirection(wo, fresnel, e), passed / (e * e) * transmittance_->eval(uv), e == 1.0f,
                             e};
  }
  float deltaProbability(const Vec3&, const Vec2&) const override { return 1.0f; }

  LobeMixture mixture(const Vec3&, const Vec2&) const override { return {}; }

  /// The albedo for flux: without the scaling of radiance by the squared index.
  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    const double eta = wo.z() > 0.0f ? eta_ : 1.0 / eta_;
    const float r = static_cast<float>(fresnelDielectric(std::abs(wo.z()), eta).reflectance);
    return r * reflectance_->eval(uv) + (1.0f - r) * transmittance_->eval(uv);
  }

  bool transmits() const override { return true; }

 private:
  static Vec3 refractedDirection(const Vec3& wo, const DielectricFresnel& fresnel, float eta) {
    return {-wo.x() / eta, -wo.y() / eta, static_cast<float>(std::copysign(fresnel.cosTransmitted, -wo.z()))};
  }

  double eta_;  ///< inside over outside
  TexturePtr reflectance_;
  TexturePtr transmittance_;
};

}  // namespace

BsdfPtr makeDielectric(const Parameters& parameters) {
  return std::make_shared<Dielectric>(readRelativeIor(parameters, "bk7"),
                                      readReflectance(parameters, {"specular_reflectance", grey(1.0f)}),
                                      readReflectance(parameters, {"specular_transmittance", grey(1.0f)}));
}

}  // namespace lobe
