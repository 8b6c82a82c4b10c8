#pragma once
// Internal to materials/: the sum of a glossy and a Lambertian lobe, each with a colour, for empirical models.

#include <array>

#include "materials/bsdf.h"
#include "materials/texture.h"
#include "runtime/core/sampling.h"

namespace lobe {

/// specular(uv) · lobe + diffuse(uv) / π, above the surface. The sampler chooses each part in proportion to the
/// luminance of its colour. Whether energy is conserved depends on the lobe and the colours.
class LobeOnDiffuse final : public Bsdf {
 public:
  LobeOnDiffuse(LobePtr lobe, TexturePtr specular, TexturePtr diffuse)
      : lobes_{std::move(lobe)}, specular_(std::move(specular)), diffuse_(std::move(diffuse)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return Rgb::Zero();
    return static_cast<float>(lobes_[0]->eval(wo, wi)) * specular_->eval(uv) + diffuse_->eval(uv) * kInvPi;
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (!(wo.z() > 0.0f)) return std::nullopt;
    Vec3 wi = squareToCosineHemisphere(u);
    if (choice < glossyProbability(uv)) {
      const std::optional<LobeSample> drawn = lobes_[0]->sample(wo, u);
      if (!drawn) return std::nullopt;
      wi = drawn->wi;
    }
    const float density = pdf(wo, wi, uv);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{wi, eval(wo, wi, uv), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0f;
    const float glossy = glossyProbability(uv);
    return glossy * lobes_[0]->pdf(wo, wi) + (1.0f - glossy) * cosineHemispherePdf(wi);
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (!(wo.z() > 0.0f)) return result;
    result.glossy[0] = {0, luminance(specular_->eval(uv))};
    result.glossyCount = 1;
    result.constant = luminance(diffuse_->eval(uv));
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? Rgb(specular_->eval(uv) + diffuse_->eval(uv)) : Rgb::Zero();
  }

 private:
  float glossyProbability(const Vec2& uv) const {
    const float glossy = luminance(specular_->eval(uv));
    return glossy > 0.0f ? glossy / (glossy + luminance(diffuse_->eval(uv))) : 0.0f;
  }

  std::array<LobePtr, 1> lobes_;
  TexturePtr specular_;
  TexturePtr diffuse_;
};

}  // namespace lobe
