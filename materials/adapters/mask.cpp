// A model with an opacity; the rest of the light passes straight through the surface.

#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

class Mask final : public Bsdf {
 public:
  Mask(BsdfPtr nested, TexturePtr opacity) : nested_(std::move(nested)), opacity_(std::move(opacity)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    return nested_->eval(wo, wi, uv) * opacity(uv);
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    std::optional<BsdfSample> result = nested_->sample(wo, uv, choice, u);
    if (result) result->f *= opacity(uv);
    return result;
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override { return nested_->pdf(wo, wi, uv); }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const override {
    const Rgb a = opacity(uv);
    const Choice p = choiceAt(a, wo, uv);
    const float total = p.pass + p.nestedDelta;
    if (!(total > 0.0f)) return std::nullopt;
    const float pass = p.pass / total;
    if (choice < pass) return DeltaSample{-wo, (1.0f - a) / pass, 1.0f, pass};
    std::optional<DeltaSample> result = nested_->sampleDelta(wo, uv, rescaledAbove(pass, choice));
    if (!result) return std::nullopt;
    result->weight *= a / (1.0f - pass);
    result->probability *= 1.0f - pass;
    result->component = 0.5 * (1.0 + result->component);
    return result;
  }

  /// Where both the surface and the nested model pass light, their directions may differ.
  std::optional<DeltaTransmission> deltaTransmission(const Vec3& wo, const Vec2& uv) const override {
    const Rgb a = opacity(uv);
    const bool passes = (a < 1.0f).any();
    std::optional<DeltaTransmission> nested;
    if ((a > 0.0f).any()) nested = nested_->deltaTransmission(wo, uv);
    if (!nested && (a > 0.0f).any() && nested_->transmits() && nested_->deltaProbability(wo, uv) > 0.0f)
      return std::nullopt;  // in a direction that is not known
    if (!nested) return passes ? std::optional(DeltaTransmission{-wo, 1.0f - a, true}) : std::nullopt;
    if (passes && !nested->straight) return std::nullopt;
    nested->weight = nested->weight * a + (1.0f - a);
    return nested;
  }

  float deltaProbability(const Vec3& wo, const Vec2& uv) const override {
    const Choice p = choiceAt(opacity(uv), wo, uv);
    return std::min(1.0f, p.pass + p.nestedDelta);
  }

  std::span<const LobePtr> lobes() const override { return nested_->lobes(); }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result = nested_->mixture(wo, uv);
    const float scale = luminance(opacity(uv));
    for (int i = 0; i < result.glossyCount; ++i) result.glossy[static_cast<std::size_t>(i)].tint *= scale;
    result.constant *= scale;
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    const Rgb a = opacity(uv);
    return nested_->albedo(wo, uv) * a + (1.0f - a);
  }

  bool transmits() const override { return true; }

  /// Light passes whatever the mapped normal is: where the viewer is behind it, a point that lets light pass has the
  /// unmapped normal.
  Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const override {
    const Vec3 normal = nested_->perturbedNormal(wo, uv, dpdu, dpdv);
    const bool behind = wo.z() * wo.dot(normal) <= 0.0f;
    return behind && (opacity(uv) < 1.0f).any() ? Vec3(Vec3::UnitZ()) : normal;
  }
  bool mapsNormals() const override { return nested_->mapsNormals(); }
  bool shadowsTerminator() const override { return nested_->shadowsTerminator(); }

 private:
  /// Probabilities of passing through and of the nested model's delta part; the rest is its smooth part.
  struct Choice {
    float pass;
    float nestedDelta;
  };

  Choice choiceAt(const Rgb& a, const Vec3& wo, const Vec2& uv) const {
    const float through = luminance(1.0f - a);
    const float pass = through / (through + luminance(a));
    return {pass, (1.0f - pass) * nested_->deltaProbability(wo, uv)};
  }

  Rgb opacity(const Vec2& uv) const { return opacity_->eval(uv).max(0.0f).min(1.0f); }

  BsdfPtr nested_;
  TexturePtr opacity_;
};

}  // namespace

BsdfPtr makeMask(const Parameters& parameters) {
  return std::make_shared<Mask>(parameters.onlyChild(), readReflectance(parameters, {"opacity", grey(0.5f)}));
}

}  // namespace lobe
