// Lambert's ideal diffuse reflection.

#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

class Diffuse final : public Bsdf {
 public:
  explicit Diffuse(TexturePtr reflectance) : reflectance_(std::move(reflectance)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return Rgb::Zero();
    return reflectance_->eval(uv) * kInvPi;
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

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (wo.z() > 0.0f) result.constant = luminance(reflectance_->eval(uv));
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? reflectance_->eval(uv) : Rgb::Zero();
  }

 private:
  TexturePtr reflectance_;
};

}  // namespace

BsdfPtr makeDiffuse(const Parameters& parameters) {
  // Mitsuba 0.4 and earlier use the name diffuseReflectance.
  const char* name = parameters.has("diffuse_reflectance") ? "diffuse_reflectance" : "reflectance";
  return std::make_shared<Diffuse>(readReflectance(parameters, {name, grey(0.5f)}));
}

}  // namespace lobe
