// A rough interface between two dielectrics: reflects and refracts.

#include <array>
#include <cmath>

#include "materials/ior.h"
#include "materials/lobes/dielectric_lobe.h"
#include "materials/lobes/rough_interface.h"
#include "materials/lobes/rough_transmittance.h"
#include "materials/lobes/roughness.h"
#include "materials/models.h"
#include "materials/reflectance.h"

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;

class RoughDielectric final : public Bsdf {
 public:
  RoughDielectric(Roughness roughness, double eta, TexturePtr reflectance, TexturePtr transmittance)
      : roughness_(std::move(roughness)),
        sides_{Side(roughness_, eta), Side(roughness_, 1.0 / eta)},
        reflectance_(std::move(reflectance)),
        transmittance_(std::move(transmittance)) {
    for (const Side& side : sides_)
      for (const Microfacet& level : roughness_.levels())
        lobes_.push_back(std::make_shared<DielectricLobe>(level, side.eta));
  }

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    const FacetScattering s = scattering(roughness_.at(uv).microfacet, wo, wi);
    return s.value > 0.0 ? value(s, fractionsAt(wo, s.cosHalf, uv)) : Rgb::Zero();
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (wo.z() == 0.0f) return std::nullopt;
    const double eta = sideOf(wo).eta;
    const Microfacet microfacet = roughness_.at(uv).microfacet;
    const Vec3d o = upright(wo, wo).cast<double>().normalized();
    const Vec3d m = microfacet.sampleVisible(o, u);
    const double c = o.dot(m);
    const bool reflects = choice < fractionsAt(wo, c, uv).probability(true);
    const Vec3d i =
        reflects ? Vec3d(2.0 * c * m - o) : Vec3d((c / eta - fresnelDielectric(c, eta).cosTransmitted) * m - o / eta);
    const Vec3 wi = upright(i.normalized().cast<float>(), wo);
    const FacetScattering s = scattering(microfacet, wo, wi);
    if (s.reflects != reflects) return std::nullopt;
    const Fractions fractions = fractionsAt(wo, s.cosHalf, uv);
    const float drawn = density(s, fractions);
    if (!(drawn > 0.0f)) return std::nullopt;
    return BsdfSample{wi, value(s, fractions), drawn, reflects ? 1.0f : static_cast<float>(eta)};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    const FacetScattering s = scattering(roughness_.at(uv).microfacet, wo, wi);
    return s.density > 0.0 ? density(s, fractionsAt(wo, s.cosHalf, uv)) : 0.0f;
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (wo.z() == 0.0f) return result;
    const int firstLobe = wo.z() > 0.0f ? 0 : static_cast<int>(roughness_.levels().size());
    addLevels(result, firstLobe, roughness_.at(uv), luminance(reflectance_->eval(uv)));
    result.undescribedFraction = meanFractions(wo, uv).probability(false);
    return result;
  }

  /// The albedo for flux: without the scaling of radiance by the squared index. Energy that single scattering loses
  /// between facets counts as reflected.
  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    const Fractions mean = meanFractions(wo, uv);
    return mean.reflected + mean.refracted;
  }

  bool transmits() const override { return true; }

 private:
  /// The interface as seen from one side.
  struct Side {
    Side(const Roughness& roughness, double relative) : eta(relative), transmittance(roughness, relative) {}

    double eta;  ///< index of the far side over that of this side
    VaryingTransmittance transmittance;
  };

  /// The fractions of light that a facet reflects and refracts, tints included.
  struct Fractions {
    Rgb reflected, refracted;
    /// Sampling probability of reflection or refraction, in proportion to luminance; 0 if both are black.
    float probability(bool reflects) const {
      const float total = luminance(reflected) + luminance(refracted);
      return total > 0.0f ? luminance(reflects ? reflected : refracted) / total : 0.0f;
    }
  };

  const Side& sideOf(const Vec3& wo) const { return sides_[wo.z() > 0.0f ? 0 : 1]; }
  /// Maps w to the frame in which wo is above the surface; its own inverse.
  static Vec3 upright(const Vec3& w, const Vec3& wo) { return wo.z() > 0.0f ? w : Vec3(w.x(), w.y(), -w.z()); }

  FacetScattering scattering(const Microfacet& microfacet, const Vec3& wo, const Vec3& wi) const {
    return scatterAtFacets(microfacet, sideOf(wo).eta, upright(wo, wo), upright(wi, wo));
  }
  static Rgb value(const FacetScattering& s, const Fractions& fractions) {
    return static_cast<float>(s.value) * (s.reflects ? fractions.reflected : fractions.refracted);
  }
  static float density(const FacetScattering& s, const Fractions& fractions) {
    return static_cast<float>(s.density) * fractions.probability(s.reflects);
  }

  Fractions fractions(double reflectance, const Vec2& uv) const {
    const float r = static_cast<float>(reflectance);
    return {r * reflectance_->eval(uv), (1.0f - r) * transmittance_->eval(uv)};
  }
  Fractions fractionsAt(const Vec3& wo, double cosHalf, const Vec2& uv) const {
    return fractions(fresnelDielectric(cosHalf, sideOf(wo).eta).reflectance, uv);
  }
  Fractions meanFractions(const Vec3& wo, const Vec2& uv) const {
    return fractions(1.0f - sideOf(wo).transmittance(roughness_.at(uv), std::abs(wo.z())), uv);
  }

  Roughness roughness_;
  std::array<Side, 2> sides_;   ///< from outside, from inside
  std::vector<LobePtr> lobes_;  ///< one for each roughness level from outside, then from inside
  TexturePtr reflectance_;
  TexturePtr transmittance_;
};

}  // namespace

BsdfPtr makeRoughDielectric(const Parameters& parameters) {
  const double eta = readRelativeIor(parameters, "bk7");
  // With equal indices every facet transmits light straight through, and there is no half vector.
  if (std::abs(eta - 1.0) < 1e-6) throw ParameterError("int_ior", "int_ior and ext_ior must differ");
  return std::make_shared<RoughDielectric>(Roughness::read(parameters), eta,
                                           readReflectance(parameters, {"specular_reflectance", grey(1.0f)}),
                                           readReflectance(parameters, {"specular_transmittance", grey(1.0f)}));
}

}  // namespace lobe
