// Disney's principled model for thin surfaces as in Mitsuba 3 (Burley 2015): diffuse reflection with sheen, diffuse
// transmission, and a GGX interface that reflects, or transmits light without refraction. Both sides are the same.

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "materials/lobes/fresnel.h"
#include "materials/lobes/principled_diffuse.h"
#include "materials/lobes/principled_parameters.h"
#include "materials/lobes/principled_specular.h"
#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/sampling.h"

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;

struct Textures {
  TexturePtr baseColour, roughness, anisotropic, specTrans, diffTrans, eta, specTint, sheen, sheenTint, flatness;
};

/// Sampling probabilities of the parts, before normalisation.
struct Rates {
  float reflected, transmitted, diffuseReflected, diffuseTransmitted;
  float sum() const { return reflected + transmitted + diffuseReflected + diffuseTransmitted; }
};

Vec3 flipped(const Vec3& w) {
  return {w.x(), w.y(), -w.z()};
}

/// Transmission is less rough than reflection, depending on the index (Burley 2015, figure 15).
float transmissionRoughness(float roughness, float eta) {
  return std::clamp((0.65f * eta - 0.35f) * roughness, 0.0f, 1.0f);
}

/// The material at one point. All functions expect wo above the surface; callers mirror directions for the back.
class Point {
 public:
  Point(const Textures& t, const Rates& rates, const Vec2& uv)
      : base_(t.baseColour->eval(uv).max(0.0f)),
        roughness_(weightOf(t.roughness, uv)),
        specTint_(weightOf(t.specTint, uv)),
        sheen_(weightOf(t.sheen, uv)),
        sheenTint_(weightOf(t.sheenTint, uv)),
        flatness_(weightOf(t.flatness, uv)),
        eta_(std::max(1e-3f, t.eta->evalNumber(uv))),
        reflecting_(principledInterface(roughness_, weightOf(t.anisotropic, uv))),
        transmitting_(principledInterface(transmissionRoughness(roughness_, eta_), weightOf(t.anisotropic, uv))),
        specular_(weightOf(t.specTrans, uv)) {
    const float through = std::clamp(0.5f * t.diffTrans->evalNumber(uv), 0.0f, 1.0f);
    diffuseReflected_ = (1.0f - specular_) * (1.0f - through);
    diffuseTransmitted_ = (1.0f - specular_) * through;
    fractions_ = {0.5f * specular_ * rates.reflected, 0.5f * specular_ * rates.transmitted,
                  diffuseReflected_ * rates.diffuseReflected, diffuseTransmitted_ * rates.diffuseTransmitted};
    if (const float total = fractions_.sum(); total > 0.0f)
      fractions_ = {fractions_.reflected / total, fractions_.transmitted / total, fractions_.diffuseReflected / total,
                    fractions_.diffuseTransmitted / total};
  }

  Rgb eval(const Vec3& wo, const Vec3& wi) const { return wi.z() > 0.0f ? reflected(wo, wi) : transmitted(wo, wi); }

  float pdf(const Vec3& wo, const Vec3& wi) const {
    if (wi.z() > 0.0f)
      return fractions_.reflected * static_cast<float>(reflecting_.reflectionPdf(wo, wi)) +
             fractions_.diffuseReflected * cosineHemispherePdf(wi);
    const float glossy = facesAway(wo, wi) ? static_cast<float>(transmitting_.reflectionPdf(wo, flipped(wi))) : 0.0f;
    return fractions_.transmitted * glossy + fractions_.diffuseTransmitted * cosineHemispherePdf(flipped(wi));
  }

  /// Samples a direction with density pdf; callers must reject results for which pdf returns 0.
  std::optional<Vec3> sample(const Vec3& wo, float choice, const Vec2& u) const {
    if (choice < fractions_.reflected) return reflecting_.sampleReflection(wo, u);
    choice -= fractions_.reflected;
    if (choice < fractions_.transmitted) {
      const std::optional<Vec3> mirrored = transmitting_.sampleReflection(wo, u);
      if (!mirrored || !facesAway(wo, flipped(*mirrored))) return std::nullopt;
      return flipped(*mirrored);
    }
    const Vec3 wi = squareToCosineHemisphere(u);
    return choice - fractions_.transmitted < fractions_.diffuseReflected ? wi : flipped(wi);
  }

  /// The tint of the white lobe, given its averages.
  Rgb tint(const SpecularAverages& averages) const {
    if (!(averages.white > 0.0f)) return Rgb::Zero();
    return specular_ * fresnel(averages.dielectric / averages.white, averages.schlick / averages.white);
  }
  Rgb diffuseAlbedo(float cosine) const { return diffuse(PrincipledDiffuse::albedo(cosine)); }
  Rgb transmittedAlbedo(const SpecularAverages& averages) const {
    return (specular_ * averages.entered + diffuseTransmitted_) * base_;
  }

 private:
  /// Whether wi is on the far side of the facet that scatters wo into wi.
  static bool facesAway(const Vec3& wo, const Vec3& wi) { return wi.dot(wo + flipped(wi)) < 0.0f; }

  Rgb reflected(const Vec3& wo, const Vec3& wi) const {
    double cosHalf = 0.0;
    const auto facets = static_cast<float>(reflecting_.reflection(wo, wi, &cosHalf));
    Rgb value = diffuse(PrincipledDiffuse::between(wo, wi));
    if (specular_ > 0.0f && facets > 0.0f)
      value += specular_ * facets *
               fresnel(static_cast<float>(fresnelDielectric(cosHalf, eta_).reflectance),
                       static_cast<float>(schlick(0.0, cosHalf, eta_)));
    return value;
  }

  Rgb transmitted(const Vec3& wo, const Vec3& wi) const {
    Rgb value = diffuseTransmitted_ * kInvPi * base_;
    if (!(specular_ > 0.0f && facesAway(wo, wi))) return value;
    double cosHalf = 0.0;
    const double facets = transmitting_.reflection(wo, flipped(wi), &cosHalf);
    if (facets > 0.0)
      value += static_cast<float>(facets * (1.0 - fresnelDielectric(cosHalf, eta_).reflectance)) * specular_ * base_;
    return value;
  }

  /// Blends the Fresnel reflectance of the dielectric and its tinted Schlick approximation.
  Rgb fresnel(float dielectric, float schlickWeight) const {
    const float normal = (eta_ - 1.0f) / (eta_ + 1.0f);
    const Rgb f0 = principledHue(base_) * (normal * normal);
    return (1.0f - specTint_) * dielectric + specTint_ * (f0 + (1.0f - f0) * schlickWeight);
  }

  Rgb diffuse(const PrincipledDiffuse& terms) const {
    const Rgb sheenColour = 1.0f - sheenTint_ + sheenTint_ * principledHue(base_);
    return diffuseReflected_ * (terms.diffuse(roughness_, flatness_) * base_ + sheen_ * terms.sheen * sheenColour);
  }

  Rgb base_;
  float roughness_, specTint_, sheen_, sheenTint_, flatness_, eta_;
  Microfacet reflecting_;
  Microfacet transmitting_;
  float specular_;
  float diffuseReflected_ = 0.0f, diffuseTransmitted_ = 0.0f;
  Rates fractions_{};
};

class PrincipledThin final : public Bsdf {
 public:
  PrincipledThin(Textures textures, const Rates& rates)
      : textures_(std::move(textures)),
        rates_(rates),
        averages_(meanAlpha(), std::max(1e-3f, luminance(textures_.eta->mean()))),
        transmits_(textures_.specTrans->largest().maxCoeff() > 0.0f ||
                   textures_.diffTrans->largest().maxCoeff() > 0.0f) {
    if (textures_.specTrans->largest().maxCoeff() > 0.0f)
      lobes_.push_back(std::make_shared<WhiteLobe>(meanInterface()));
  }

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (wo.z() == 0.0f || wi.z() == 0.0f) return Rgb::Zero();
    return at(uv).eval(upright(wo, wo), upright(wi, wo));
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (wo.z() == 0.0f) return std::nullopt;
    const Vec3 above = upright(wo, wo);
    const Point point = at(uv);
    const std::optional<Vec3> wi = point.sample(above, choice, u);
    if (!wi || wi->z() == 0.0f) return std::nullopt;
    const float density = point.pdf(above, *wi);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{upright(*wi, wo), point.eval(above, *wi), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (wo.z() == 0.0f || wi.z() == 0.0f) return 0.0f;
    return at(uv).pdf(upright(wo, wo), upright(wi, wo));
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    const Parts parts = partsAt(wo, uv);
    if (!lobes_.empty()) result.glossy[static_cast<std::size_t>(result.glossyCount++)] = {0, luminance(parts.tint)};
    result.constant = luminance(parts.diffuse);
    const float transmitted = luminance(parts.transmitted);
    const float all = luminance(parts.tint * parts.white + parts.diffuse) + transmitted;
    if (transmitted > 0.0f) result.undescribedFraction = transmitted / all;
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    const Parts parts = partsAt(wo, uv);
    return parts.tint * parts.white + parts.diffuse + parts.transmitted;
  }

  bool transmits() const override { return transmits_; }

 private:
  struct Parts {
    Rgb tint, diffuse, transmitted;
    float white;
  };

  Parts partsAt(const Vec3& wo, const Vec2& uv) const {
    const Point point = at(uv);
    const float cosine = std::abs(wo.z());
    const SpecularAverages averages = averages_.at(cosine);
    return {point.tint(averages), point.diffuseAlbedo(cosine), point.transmittedAlbedo(averages), averages.white};
  }

  /// Maps w to the frame in which wo is above the surface; its own inverse.
  static Vec3 upright(const Vec3& w, const Vec3& wo) { return wo.z() > 0.0f ? w : flipped(w); }
  Point at(const Vec2& uv) const { return {textures_, rates_, uv}; }

  Microfacet meanInterface() const {
    const auto mean = [](const TexturePtr& texture) { return std::clamp(luminance(texture->mean()), 0.0f, 1.0f); };
    return principledInterface(mean(textures_.roughness), mean(textures_.anisotropic));
  }
  double meanAlpha() const { return std::sqrt(meanInterface().alphaU() * meanInterface().alphaV()); }

  Textures textures_;
  Rates rates_;
  std::vector<LobePtr> lobes_;  // the reflecting interface, if there is one
  SpecularTable averages_;
  bool transmits_;
};

/// Reads diff_trans, which ranges from 0 (all diffuse light is reflected) to 2 (all is transmitted).
TexturePtr readDiffuseTransmission(const Parameters& parameters) {
  TexturePtr texture = parameters.texture("diff_trans", grey(0.0f));
  if (const float mean = texture->mean().maxCoeff(); !(mean <= 2.0f))
    throw ParameterError("diff_trans", fmt::format("diff_trans must be in [0, 2], not {}", mean));
  return texture;
}

TexturePtr readThinEta(const Parameters& parameters) {
  TexturePtr texture = parameters.texture("eta", grey(1.5f));
  if (const float mean = luminance(texture->mean()); !(mean > 0.0f && mean <= 100.0f))
    throw ParameterError("eta", fmt::format("eta must be positive and at most 100, not {}", mean));
  return texture;
}

}  // namespace

BsdfPtr makePrincipledThin(const Parameters& parameters) {
  const auto weight = [&](const char* name, float fallback) { return readWeight(parameters, name, fallback); };
  Textures textures{readReflectance(parameters, {"base_color", grey(0.5f)}),
                    weight("roughness", 0.5f),
                    weight("anisotropic", 0.0f),
                    weight("spec_trans", 0.0f),
                    readDiffuseTransmission(parameters),
                    readThinEta(parameters),
                    weight("spec_tint", 0.0f),
                    weight("sheen", 0.0f),
                    weight("sheen_tint", 0.0f),
                    weight("flatness", 0.0f)};
  const Rates rates{readRate(parameters, "specular_reflectance_sampling_rate"),
                    readRate(parameters, "specular_transmittance_sampling_rate"),
                    readRate(parameters, "diffuse_reflectance_sampling_rate"),
                    readRate(parameters, "diffuse_transmittance_sampling_rate")};
  return std::make_shared<PrincipledThin>(std::move(textures), rates);
}

}  // namespace lobe
