// A rough, absorbing dielectric coating over another model, as in Mitsuba 0.6: the coating reflects as a microfacet
// surface, but refracts light on its way in and out as if it were smooth.

#include "materials/adapters/coated_base.h"
#include "materials/adapters/coating_parameters.h"
#include "materials/lobes/dielectric_lobe.h"
#include "materials/lobes/rough_transmittance.h"
#include "materials/lobes/roughness.h"
#include "materials/models.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

/// Maps w to the frame in which wo is above the surface; its own inverse.
Vec3 upright(const Vec3& w, const Vec3& wo) {
  return wo.z() > 0.0f ? w : Vec3(w.x(), w.y(), -w.z());
}

class RoughCoating final : public CoatedBsdf {
 public:
  RoughCoating(Roughness roughness, const CoatingParameters& p)
      : CoatedBsdf(CoatedBase(p.nested, p.eta, p.depth)),
        roughness_(std::move(roughness)),
        eta_(p.eta),
        transmittance_(roughness_, eta_),
        specular_(p.specular) {
    for (const Microfacet& level : roughness_.levels()) lobes_.push_back(std::make_shared<DielectricLobe>(level, eta_));
  }

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (wo.z() == 0.0f || wi.z() == 0.0f) return Rgb::Zero();
    const LocalRoughness roughness = roughness_.at(uv);
    double cosHalf = 0.0;
    const double facets = roughness.microfacet.reflection(upright(wo, wo), upright(wi, wo), &cosHalf);
    const double glossy = facets > 0.0 ? facets * fresnelDielectric(cosHalf, eta_).reflectance : 0.0;
    return static_cast<float>(glossy) * specular_->eval(uv) +
           base().eval(wo, wi, uv) * (passing(roughness, wo) * passing(roughness, wi));
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (wo.z() == 0.0f) return std::nullopt;
    const LocalRoughness roughness = roughness_.at(uv);
    const float p = partsAt(roughness, wo, uv).glossyProbability();
    if (choice < p) {
      const std::optional<Vec3> wi = roughness.microfacet.sampleReflection(upright(wo, wo), u);
      return wi ? sampled(wo, upright(*wi, wo), uv, 1.0f) : std::nullopt;
    }
    const std::optional<BsdfSample> nested = base().sample(wo, uv, rescaledAbove(p, choice), u);
    return nested ? sampled(wo, nested->wi, uv, nested->eta) : std::nullopt;
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (wo.z() == 0.0f || wi.z() == 0.0f) return 0.0f;
    const LocalRoughness roughness = roughness_.at(uv);
    const float p = partsAt(roughness, wo, uv).glossyProbability();
    return p * static_cast<float>(roughness.microfacet.reflectionPdf(upright(wo, wo), upright(wi, wo))) +
           (1.0f - p) * base().pdf(wo, wi, uv);
  }

  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const override {
    std::optional<DeltaSample> result = base().sampleDelta(wo, uv, choice);
    const LocalRoughness roughness = roughness_.at(uv);
    if (result) result->weight *= passing(roughness, wo) * passing(roughness, result->wi);
    return result;
  }

  float deltaProbability(const Vec3& wo, const Vec2& uv) const override {
    const Parts parts = partsAt(roughness_.at(uv), wo, uv);
    const float delta = luminance(parts.nested.delta);
    return delta > 0.0f ? delta / (delta + parts.smooth()) : 0.0f;
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  /// Refraction changes the nested model's lobes, so they are not described here but left to its sampler.
  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (wo.z() == 0.0f) return result;
    const LocalRoughness roughness = roughness_.at(uv);
    addLevels(result, 0, roughness, luminance(specular_->eval(uv)));
    const Parts parts = partsAt(roughness, wo, uv);
    result.constant = luminance(parts.nested.constant);
    const float undescribed = luminance(parts.nested.directional);
    if (undescribed > 0.0f) result.undescribedFraction = undescribed / parts.smooth();
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    if (wo.z() == 0.0f) return Rgb::Zero();
    const Parts parts = partsAt(roughness_.at(uv), wo, uv);
    return parts.glossy + parts.nested.sum();
  }

 private:
  /// Albedos of the coating's own reflection and of the nested model.
  struct Parts {
    Rgb glossy;
    CoatedBase::Albedo nested;
    float smooth() const { return luminance(glossy + nested.constant + nested.directional); }
    float glossyProbability() const { return luminance(glossy) > 0.0f ? luminance(glossy) / smooth() : 0.0f; }
  };

  /// Energy that single scattering loses between facets counts as reflected.
  Parts partsAt(const LocalRoughness& roughness, const Vec3& wo, const Vec2& uv) const {
    return {(1.0f - passing(roughness, wo)) * specular_->eval(uv),
            base().albedo(wo, uv, [&](float cosine) { return transmittance_(roughness, cosine); })};
  }
  float passing(const LocalRoughness& roughness, const Vec3& w) const {
    return transmittance_(roughness, std::abs(w.z()));
  }

  std::optional<BsdfSample> sampled(const Vec3& wo, const Vec3& wi, const Vec2& uv, float eta) const {
    const float density = pdf(wo, wi, uv);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{wi, eval(wo, wi, uv), density, eta};
  }

  Roughness roughness_;
  double eta_;
  VaryingTransmittance transmittance_;
  std::vector<LobePtr> lobes_;  ///< one for each roughness level
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makeRoughCoating(const Parameters& parameters) {
  Roughness roughness = Roughness::read(parameters);
  if (!roughness.isotropic())
    throw ParameterError("alpha_u", "roughcoating must be isotropic: give alpha instead of alpha_u and alpha_v");
  return std::make_shared<RoughCoating>(std::move(roughness), readCoating(parameters));
}

}  // namespace lobe
