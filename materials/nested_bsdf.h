#pragma once
// Internal to materials/: a model that reflects as another does, and changes only the normal.

#include "materials/bsdf.h"

namespace lobe {

class NestedBsdf : public Bsdf {
 public:
  explicit NestedBsdf(BsdfPtr nested) : nested_(std::move(nested)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final { return nested_->eval(wo, wi, uv); }
  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const final {
    return nested_->sample(wo, uv, choice, u);
  }
  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final { return nested_->pdf(wo, wi, uv); }
  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const final {
    return nested_->sampleDelta(wo, uv, choice);
  }
  float deltaProbability(const Vec3& wo, const Vec2& uv) const final { return nested_->deltaProbability(wo, uv); }
  std::span<const LobePtr> lobes() const final { return nested_->lobes(); }
  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const final { return nested_->mixture(wo, uv); }
  Rgb albedo(const Vec3& wo, const Vec2& uv) const final { return nested_->albedo(wo, uv); }
  bool transmits() const final { return nested_->transmits(); }

  Vec3 perturbedNormal(const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const override = 0;

 protected:
  const Bsdf& nested() const { return *nested_; }

 private:
  BsdfPtr nested_;
};

}  // namespace lobe
