// A thin slab of a dielectric, such as a window pane: sums the reflections within the slab and neglects the offset of
// the transmitted ray.

#include <cmath>

#include "materials/ior.h"
#include "materials/lobes/fresnel.h"
#include "materials/models.h"
#include "materials/reflectance.h"

namespace lobe {
namespace {

class ThinDielectric final : public Bsdf {
 public:
  ThinDielectric(double eta, TexturePtr reflectance, TexturePtr transmittance)
      : eta_(eta), reflectance_(std::move(reflectance)), transmittance_(std::move(transmittance)) {}

  Rgb eval(const Vec3&, const Vec3&, const Vec2&) const override { return Rgb::Zero(); }
  std::optional<BsdfSample> sample(const Vec3&, const Vec2&, float, const Vec2&) const override { return std::nullopt; }
  float pdf(const Vec3&, const Vec3&, const Vec2&) const override { return 0.0f; }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const override {
    const float r = slabReflectance(wo);
    const Rgb reflected = r * reflectance_->eval(uv);
    const Rgb passed = (1.0f - r) * transmittance_->eval(uv);
    const float total = luminance(reflected) + luminance(passed);
    if (!(total > 0.0f) || wo.z() == 0.0f) return std::nullopt;
    const float p = luminance(reflected) / total;
    if (choice < p) return DeltaSample{Vec3(-wo.x(), -wo.y(), wo.z()), reflected / p, 1.0f, p};
    return DeltaSample{-wo, passed / (1.0f - p), 1.0f, 1.0f - p, 0.5};
  }
  std::optional<DeltaTransmission> deltaTransmission(const Vec3& wo, const Vec2& uv) const override {
    return DeltaTransmission{-wo, (1.0f - slabReflectance(wo)) * transmittance_->eval(uv), true};
  }
  float deltaProbability(const Vec3&, const Vec2&) const override { return 1.0f; }

  LobeMixture mixture(const Vec3&, const Vec2&) const override { return {}; }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    const float r = slabReflectance(wo);
    return r * reflectance_->eval(uv) + (1.0f - r) * transmittance_->eval(uv);
  }

  bool transmits() const override { return true; }

 private:
  /// R + T R T + T R³ T + … = R + T² R / (1 − R²), which is 2R / (1 + R).
  float slabReflectance(const Vec3& wo) const {
    const double r = fresnelDielectric(std::abs(wo.z()), eta_).reflectance;
    return static_cast<float>(2.0 * r / (1.0 + r));
  }

  double eta_;
  TexturePtr reflectance_;
  TexturePtr transmittance_;
};

}  // namespace

BsdfPtr makeThinDielectric(const Parameters& parameters) {
  return std::make_shared<ThinDielectric>(readRelativeIor(parameters, "bk7"),
                                          readReflectance(parameters, {"specular_reflectance", grey(1.0f)}),
                                          readReflectance(parameters, {"specular_transmittance", grey(1.0f)}));
}

}  // namespace lobe
