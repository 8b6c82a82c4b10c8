// Lambertian transmission: light that arrives on one side leaves the other with uniform radiance, as for thin paper.

#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

class DiffuseTransmitter final : public Bsdf {
 public:
  explicit DiffuseTransmitter(TexturePtr transmittance) : transmittance_(std::move(transmittance)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    return crosses(wo, wi) ? Rgb(transmittance_->eval(uv) * kInvPi) : Rgb::Zero();
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float, const Vec2& u) const override {
    Vec3 wi = squareToCosineHemisphere(u);
    if (wo.z() > 0.0f) wi.z() = -wi.z();
    const float density = pdf(wo, wi, uv);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{wi, eval(wo, wi, uv), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2&) const override {
    return crosses(wo, wi) ? std::abs(wi.z()) * kInvPi : 0.0f;
  }

  LobeMixture mixture(const Vec3&, const Vec2&) const override {
    LobeMixture result;
    result.undescribedFraction = 1.0f;
    return result;
  }

  Rgb albedo(const Vec3&, const Vec2& uv) const override { return transmittance_->eval(uv); }
  bool transmits() const override { return true; }

 private:
  // Compares signs, because the product of two tiny cosines may underflow to 0.
  static bool crosses(const Vec3& wo, const Vec3& wi) {
    return (wo.z() > 0.0f && wi.z() < 0.0f) || (wo.z() < 0.0f && wi.z() > 0.0f);
  }

  TexturePtr transmittance_;
};

}  // namespace

BsdfPtr makeDiffTrans(const Parameters& parameters) {
  return std::make_shared<DiffuseTransmitter>(readReflectance(parameters, {"transmittance", grey(0.5f)}));
}

}  // namespace lobe
