// A perfectly smooth metal.

#include "materials/ior.h"
#include "materials/lobes/fresnel.h"
#include "materials/models.h"
#include "materials/reflectance.h"

namespace lobe {
namespace {

class Conductor final : public Bsdf {
 public:
  Conductor(const ComplexIor& ior, TexturePtr specular) : ior_(ior), specular_(std::move(specular)) {}

  Rgb eval(const Vec3&, const Vec3&, const Vec2&) const override { return Rgb::Zero(); }
  std::optional<BsdfSample> sample(const Vec3&, const Vec2&, float, const Vec2&) const override { return std::nullopt; }
  float pdf(const Vec3&, const Vec3&, const Vec2&) const override { return 0.0f; }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float) const override {
    if (!(wo.z() > 0.0f)) return std::nullopt;
    return DeltaSample{Vec3(-wo.x(), -wo.y(), wo.z()), albedo(wo, uv), 1.0f};
  }
  float deltaProbability(const Vec3&, const Vec2&) const override { return 1.0f; }

  LobeMixture mixture(const Vec3&, const Vec2&) const override { return {}; }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? Rgb(fresnelConductor(wo.z(), ior_.eta, ior_.k) * specular_->eval(uv)) : Rgb::Zero();
  }

 private:
  ComplexIor ior_;
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makeConductor(const Parameters& parameters) {
  return std::make_shared<Conductor>(readConductor(parameters),
                                     readReflectance(parameters, {"specular_reflectance", grey(1.0f)}));
}

}  // namespace lobe
