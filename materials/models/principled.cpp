// Disney's principled model as in Mitsuba 3 (Burley 2012 and 2015): a GGX interface that blends between dielectric and
// metal, plus diffuse reflection, sheen, a clear coat and, if spec_trans > 0, refraction. It does not strictly conserve
// energy: with bright colours it may reflect slightly more than it receives.

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "materials/lobes/clearcoat_lobe.h"
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
  TexturePtr baseColour, roughness, anisotropic, metallic, specTrans, specTint, sheen, sheenTint, flatness, clearcoat,
      clearcoatGloss;
};

/// Sampling probabilities of the parts, before normalisation.
struct Rates {
  float specular, clearcoat, diffuse;
};

double clearcoatAlpha(float gloss) {
  return std::lerp(0.1, 0.001, static_cast<double>(gloss));
}

Vec3 flipped(const Vec3& w) {
  return {w.x(), w.y(), -w.z()};
}

Vec3d unit(const Vec3& w) {
  return w.cast<double>().normalized();
}

/// The material at one point. All functions expect wo above the surface; callers mirror directions for the back.
class Point {
 public:
  Point(const Textures& t, const Rates& rates, double eta, const Vec2& uv, bool front)
      : base_(t.baseColour->eval(uv).max(0.0f)),
        roughness_(weightOf(t.roughness, uv)),
        metallic_(weightOf(t.metallic, uv)),
        specTint_(weightOf(t.specTint, uv)),
        sheen_(weightOf(t.sheen, uv)),
        sheenTint_(weightOf(t.sheenTint, uv)),
        flatness_(weightOf(t.flatness, uv)),
        clearcoat_(front ? 0.25f * weightOf(t.clearcoat, uv) : 0.0f),
        interface_(principledInterface(roughness_, weightOf(t.anisotropic, uv))),
        coat_(clearcoatAlpha(weightOf(t.clearcoatGloss, uv)), eta),
        eta_(front ? eta : 1.0 / eta),
        front_(front) {
    const float specTrans = weightOf(t.specTrans, uv);
    transmitting_ = (1.0f - metallic_) * specTrans;
    diffuse_ = front ? (1.0f - metallic_) * (1.0f - specTrans) : 0.0f;
    const Rates raw = front ? Rates{rates.specular, clearcoat_ * rates.clearcoat, diffuse_ * rates.diffuse}
                            : Rates{transmitting_ > 0.0f ? 1.0f : 0.0f, 0.0f, 0.0f};
    const float total = raw.specular + raw.clearcoat + raw.diffuse;
    if (total > 0.0f) fractions_ = {raw.specular / total, raw.clearcoat / total, raw.diffuse / total};
  }

  Rgb eval(const Vec3& wo, const Vec3& wi) const { return wi.z() > 0.0f ? reflected(wo, wi) : transmitted(wo, wi); }

  float pdf(const Vec3& wo, const Vec3& wi) const {
    if (wi.z() > 0.0f) {
      const Vec3d o = unit(wo);
      const double cosine = o.dot((o + unit(wi)).normalized());
      return fractions_.specular * reflectedFraction(fresnelDielectric(cosine, eta_).reflectance) *
                 static_cast<float>(interface_.reflectionPdf(wo, wi)) +
             fractions_.clearcoat * coat_.pdf(wo, wi) + fractions_.diffuse * cosineHemispherePdf(wi);
    }
    const std::optional<Refraction> r = refraction(wo, wi);
    if (!r) return 0.0f;
    const double jacobian = eta_ * eta_ * r->inside / (r->sum * r->sum);
    return fractions_.specular * (1.0f - reflectedFraction(r->reflectance)) *
           static_cast<float>(r->density * r->shadowingOut * r->outside * jacobian);
  }

  /// Samples a direction with density pdf; callers must reject results for which pdf returns 0.
  std::optional<Vec3> sample(const Vec3& wo, float choice, const Vec2& u) const {
    if (choice < fractions_.diffuse) return squareToCosineHemisphere(u);
    choice -= fractions_.diffuse;
    if (choice < fractions_.clearcoat) {
      const std::optional<LobeSample> drawn = coat_.sample(wo, u);
      return drawn ? std::optional<Vec3>(drawn->wi) : std::nullopt;
    }
    if (!(fractions_.specular > 0.0f)) return std::nullopt;
    return sampleInterface(unit(wo), (choice - fractions_.clearcoat) / fractions_.specular, u);
  }

  /// The tint of the white lobe, given its averages.
  Rgb tint(const SpecularAverages& averages) const {
    if (!(averages.white > 0.0f)) return Rgb::Zero();
    return colour(averages.dielectric / averages.white, averages.schlick / averages.white);
  }
  float clearcoat() const { return clearcoat_; }
  Rgb diffuseAlbedo(float cosine) const {
    return front_ ? diffuse(PrincipledDiffuse::albedo(cosine)) : Rgb(Rgb::Zero());
  }
  Rgb transmittedAlbedo(const SpecularAverages& averages) const {
    return transmitting_ * averages.entered * base_.sqrt();
  }

 private:
  struct Refraction {
    double density, shadowingOut, shadowingIn;  // D, and Smith's G1 over the cosines
    double outside, inside, sum;                // |wo·h|, |wi·h| and |wo·h + η wi·h|
    double reflectance;
  };

  std::optional<Refraction> refraction(const Vec3& wo, const Vec3& wi) const {
    if (!(transmitting_ > 0.0f && wi.z() < 0.0f)) return std::nullopt;
    const Vec3d o = unit(wo);
    const Vec3d i = unit(wi);
    Vec3d h = (o + eta_ * i).normalized();
    if (h.z() < 0.0) h = -h;
    const double outside = o.dot(h);
    const double inside = -i.dot(h);
    if (!(outside > 0.0 && inside > 0.0)) return std::nullopt;
    const double sum = std::abs(outside - eta_ * inside);
    if (!(sum > 1e-9)) return std::nullopt;  // nearly opposite directions at η near 1 have no half vector
    return Refraction{interface_.density(h),
                      interface_.shadowingOverCosine(o),
                      interface_.shadowingOverCosine(-i),
                      outside,
                      inside,
                      sum,
                      fresnelDielectric(outside, eta_).reflectance};
  }

  /// Walter et al. 2007, equation 21; the η² of its Jacobian cancels against the scaling of radiance.
  Rgb transmitted(const Vec3& wo, const Vec3& wi) const {
    const std::optional<Refraction> r = refraction(wo, wi);
    if (!r) return Rgb::Zero();
    const double value = (1.0 - r->reflectance) * r->density * r->shadowingOut * r->shadowingIn * r->outside *
                         r->inside / (r->sum * r->sum);
    return static_cast<float>(value) * transmitting_ * base_.sqrt();
  }

  Rgb reflected(const Vec3& wo, const Vec3& wi) const {
    double cosHalf = 0.0;
    const auto specular = static_cast<float>(interface_.reflection(wo, wi, &cosHalf));
    Rgb value = Rgb::Zero();
    if (specular > 0.0f)
      value = specular * colour(static_cast<float>(fresnelDielectric(cosHalf, eta_).reflectance),
                                static_cast<float>(schlick(0.0, cosHalf, eta_)));
    if (!front_) return value;
    if (clearcoat_ > 0.0f) value += clearcoat_ * static_cast<float>(coat_.eval(wo, wi));
    return value + diffuse(PrincipledDiffuse::between(wo, wi));
  }

  /// Blends the Fresnel reflectance of the dielectric, its tinted Schlick approximation and Schlick's reflectance of
  /// the metal; on the back only the first applies.
  Rgb colour(float dielectric, float schlickWeight) const {
    if (!front_) return grey(transmitting_ * dielectric);
    const auto normal = static_cast<float>((eta_ - 1.0) / (eta_ + 1.0));
    const auto schlicks = [&](const Rgb& f0) -> Rgb { return f0 + (1.0f - f0) * schlickWeight; };
    return (1.0f - metallic_) *
               ((1.0f - specTint_) * dielectric + specTint_ * schlicks(principledHue(base_) * (normal * normal))) +
           metallic_ * schlicks(base_);
  }

  Rgb diffuse(const PrincipledDiffuse& terms) const {
    const Rgb sheenColour = 1.0f - sheenTint_ + sheenTint_ * principledHue(base_);
    return diffuse_ * terms.diffuse(roughness_, flatness_) * base_ +
           sheen_ * (1.0f - metallic_) * terms.sheen * sheenColour;
  }

  /// The probability of sampling reflection at the interface, given its reflectance at the half vector.
  float reflectedFraction(double reflectance) const {
    const auto f = static_cast<float>(reflectance);
    return front_ ? 1.0f - transmitting_ * (1.0f - f) : f;
  }

  std::optional<Vec3> sampleInterface(const Vec3d& o, float choice, const Vec2& u) const {
    const Vec3d h = interface_.sampleVisible(o, u);
    const double cosine = std::clamp(o.dot(h), 0.0, 1.0);
    const DielectricFresnel fresnel = fresnelDielectric(cosine, eta_);
    if (choice < reflectedFraction(fresnel.reflectance)) {
      const Vec3 wi = (2.0 * cosine * h - o).normalized().cast<float>();
      return wi.z() > 0.0f ? std::optional<Vec3>(wi) : std::nullopt;
    }
    const Vec3 wi = ((cosine / eta_ - fresnel.cosTransmitted) * h - o / eta_).normalized().cast<float>();
    return wi.z() < 0.0f ? std::optional<Vec3>(wi) : std::nullopt;
  }

  Rgb base_;
  float roughness_, metallic_, specTint_, sheen_, sheenTint_, flatness_;
  float clearcoat_;
  Microfacet interface_;
  ClearcoatLobe coat_;
  double eta_;  // far side over the side of wo
  bool front_;
  float transmitting_ = 0.0f;
  float diffuse_ = 0.0f;
  Rates fractions_{};
};

class Principled final : public Bsdf {
 public:
  Principled(Textures textures, const Rates& rates, double eta)
      : textures_(std::move(textures)),
        rates_(rates),
        eta_(eta),
        transmits_(luminance(textures_.specTrans->mean()) > 0.0f),
        lobes_{std::make_shared<WhiteLobe>(meanInterface())},
        outside_(meanAlpha(), eta),
        inside_(meanAlpha(), 1.0 / eta) {
    if (luminance(textures_.clearcoat->mean()) > 0.0f)
      lobes_.push_back(std::make_shared<ClearcoatLobe>(clearcoatAlpha(weightMean(textures_.clearcoatGloss)), eta));
  }

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!sees(wo) || wi.z() == 0.0f) return Rgb::Zero();
    const bool front = wo.z() > 0.0f;
    return at(uv, front).eval(front ? wo : flipped(wo), front ? wi : flipped(wi));
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const override {
    if (!sees(wo)) return std::nullopt;
    const bool front = wo.z() > 0.0f;
    const Vec3 above = front ? wo : flipped(wo);
    const Point point = at(uv, front);
    const std::optional<Vec3> wi = point.sample(above, choice, u);
    if (!wi || wi->z() == 0.0f) return std::nullopt;
    const float density = point.pdf(above, *wi);
    if (!(density > 0.0f)) return std::nullopt;
    const double eta = wi->z() > 0.0f ? 1.0 : front ? eta_ : 1.0 / eta_;
    return BsdfSample{front ? *wi : flipped(*wi), point.eval(above, *wi), density, static_cast<float>(eta)};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    if (!sees(wo) || wi.z() == 0.0f) return 0.0f;
    const bool front = wo.z() > 0.0f;
    return at(uv, front).pdf(front ? wo : flipped(wo), front ? wi : flipped(wi));
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (!sees(wo)) return result;
    const Parts parts = partsAt(wo, uv);
    result.glossy[0] = {0, luminance(parts.tint)};
    result.glossyCount = 1;
    if (lobes_.size() > 1 && parts.clearcoat > 0.0f) result.glossy[1] = {result.glossyCount++, parts.clearcoat};
    result.constant = luminance(parts.diffuse);
    const float reflected = luminance(parts.tint * parts.white + parts.diffuse);
    const float transmitted = luminance(parts.transmitted);
    if (transmitted > 0.0f) result.undescribedFraction = transmitted / (reflected + transmitted);
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    if (!sees(wo)) return Rgb::Zero();
    const Parts parts = partsAt(wo, uv);
    // The lobe of the coat is narrow, so the normal approximates the half vector.
    const float cosine = std::abs(wo.z());
    const float coat = parts.clearcoat * (0.04f + 0.96f * schlickWeight(cosine)) * cosine * cosine;
    return (parts.tint * parts.white + parts.diffuse + parts.transmitted + coat).min(1.0f);
  }

  bool transmits() const override { return transmits_; }

 private:
  struct Parts {
    Rgb tint, diffuse, transmitted;
    float white, clearcoat;
  };

  Parts partsAt(const Vec3& wo, const Vec2& uv) const {
    const bool front = wo.z() > 0.0f;
    const Point point = at(uv, front);
    const float cosine = std::abs(wo.z());
    const SpecularAverages averages = (front ? outside_ : inside_).at(cosine);
    return {point.tint(averages), point.diffuseAlbedo(cosine), point.transmittedAlbedo(averages), averages.white,
            point.clearcoat()};
  }

  /// Whether the surface scatters light on the side of wo.
  bool sees(const Vec3& wo) const { return wo.z() > 0.0f || (wo.z() < 0.0f && transmits_); }
  Point at(const Vec2& uv, bool front) const { return {textures_, rates_, eta_, uv, front}; }

  static float weightMean(const TexturePtr& texture) { return std::clamp(luminance(texture->mean()), 0.0f, 1.0f); }
  Microfacet meanInterface() const {
    return principledInterface(weightMean(textures_.roughness), weightMean(textures_.anisotropic));
  }
  double meanAlpha() const { return std::sqrt(meanInterface().alphaU() * meanInterface().alphaV()); }

  Textures textures_;
  Rates rates_;
  double eta_;
  bool transmits_;
  std::vector<LobePtr> lobes_;  // the interface; the coat, if there is one
  SpecularTable outside_;
  SpecularTable inside_;
};

Textures readTextures(const Parameters& parameters) {
  const auto weight = [&](const char* name, float fallback) { return readWeight(parameters, name, fallback); };
  return {readReflectance(parameters, {"base_color", grey(0.5f)}),
          weight("roughness", 0.5f),
          weight("anisotropic", 0.0f),
          weight("metallic", 0.0f),
          weight("spec_trans", 0.0f),
          weight("spec_tint", 0.0f),
          weight("sheen", 0.0f),
          weight("sheen_tint", 0.0f),
          weight("flatness", 0.0f),
          weight("clearcoat", 0.0f),
          weight("clearcoat_gloss", 0.0f)};
}

/// Reads the index from eta or from specular, which implies one. If the material transmits, an index of 1 becomes
/// slightly larger, because refraction without a change of index has no half vector.
double readEta(const Parameters& parameters, bool transmits) {
  const bool byIndex = parameters.has("eta");
  const double specular = parameters.number("specular", 0.5);
  const double given = parameters.number("eta", 1.5);
  if (byIndex && parameters.has("specular")) throw ParameterError("specular", "give either eta or specular");
  if (!(given > 0.0 && given <= 100.0))
    throw ParameterError("eta", fmt::format("eta must be positive and at most 100, not {}", given));
  if (!(specular >= 0.0 && specular <= 1.0))
    throw ParameterError("specular", fmt::format("specular must be in [0, 1], not {}", specular));
  if (byIndex) return transmits && given == 1.0 ? 1.001 : given;
  const double reflecting = transmits ? std::max(specular, 1e-3) : specular;
  return 2.0 / (1.0 - std::sqrt(0.08 * reflecting)) - 1.0;
}

}  // namespace

BsdfPtr makePrincipled(const Parameters& parameters) {
  Textures textures = readTextures(parameters);
  const Rates rates{readRate(parameters, "main_specular_sampling_rate"),
                    readRate(parameters, "clearcoat_sampling_rate"),
                    readRate(parameters, "diffuse_reflectance_sampling_rate")};
  const double eta = readEta(parameters, luminance(textures.specTrans->mean()) > 0.0f);
  return std::make_shared<Principled>(std::move(textures), rates, eta);
}

}  // namespace lobe
