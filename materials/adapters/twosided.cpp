// Applies a one-sided model to both sides of a surface, or one model to each side.

#include "materials/models.h"

namespace lobe {
namespace {

Vec3 flipped(const Vec3& w) {
  return {w.x(), w.y(), -w.z()};
}

class TwoSided final : public Bsdf {
 public:
  TwoSided(BsdfPtr front, BsdfPtr back) : front_(std::move(front)), back_(std::move(back)) {
    lobes_.assign(front_->lobes().begin(), front_->lobes().end());
    if (back_ == front_) return;
    backOffset_ = static_cast<int>(lobes_.size());
    lobes_.insert(lobes_.end(), back_->lobes().begin(), back_->lobes().end());
  }

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    return wo.z() > 0.0f ? front_->eval(wo, wi, uv) : back_->eval(flipped(wo), flipped(wi), uv);
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (wo.z() > 0.0f) return front_->sample(wo, uv, choice, u);
    std::optional<BsdfSample> result = back_->sample(flipped(wo), uv, choice, u);
    if (result) result->wi = flipped(result->wi);
    return result;
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    return wo.z() > 0.0f ? front_->pdf(wo, wi, uv) : back_->pdf(flipped(wo), flipped(wi), uv);
  }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const override {
    if (wo.z() > 0.0f) return front_->sampleDelta(wo, uv, choice);
    std::optional<DeltaSample> result = back_->sampleDelta(flipped(wo), uv, choice);
    if (result) result->wi = flipped(result->wi);
    return result;
  }

  float deltaProbability(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? front_->deltaProbability(wo, uv) : back_->deltaProbability(flipped(wo), uv);
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    if (wo.z() > 0.0f) return front_->mixture(wo, uv);
    LobeMixture result = back_->mixture(flipped(wo), uv);
    for (int i = 0; i < result.glossyCount; ++i) result.glossy[static_cast<std::size_t>(i)].lobe += backOffset_;
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? front_->albedo(wo, uv) : back_->albedo(flipped(wo), uv);
  }

  /// On the back, the map is that of the mirrored surface, so that bumps protrude towards the viewer as on the front.
  Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const override {
    if (wo.z() > 0.0f) return front_->perturbedNormal(wo, uv, dpdu, dpdv);
    const Vec3 mirrored = back_->perturbedNormal(flipped(wo), uv, flipped(dpdu), flipped(dpdv));
    return {-mirrored.x(), -mirrored.y(), mirrored.z()};
  }
  bool mapsNormals() const override { return front_->mapsNormals() || back_->mapsNormals(); }
  bool shadowsTerminator() const override { return front_->shadowsTerminator() || back_->shadowsTerminator(); }

 private:
  BsdfPtr front_;
  BsdfPtr back_;
  std::vector<LobePtr> lobes_;
  int backOffset_ = 0;
};

}  // namespace

BsdfPtr makeTwoSided(const Parameters& parameters) {
  const std::vector<BsdfPtr>& children = parameters.children();
  if (children.empty() || children.size() > 2)
    throw ParameterError("", "twosided needs one nested bsdf, or two for front and back");
  for (const BsdfPtr& child : children)
    if (child->transmits())
      throw ParameterError(
          "", "twosided cannot contain a bsdf that transmits light; put a mask around it: mask > twosided");
  return std::make_shared<TwoSided>(children.front(), children.back());
}

}  // namespace lobe
