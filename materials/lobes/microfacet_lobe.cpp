#include "materials/lobes/microfacet_lobe.h"

#include <fmt/format.h>

namespace lobe {

LobeKind MicrofacetLobe::kind() const {
  return microfacet_.alphaU() == microfacet_.alphaV() ? LobeKind::isotropic : LobeKind::anisotropic;
}

std::string MicrofacetLobe::model() const {
  return fmt::format("{}-{}", microfacet_.name(), interfaceName());
}

std::string MicrofacetLobe::key() const {
  return fmt::format("{} alpha_u={:a} alpha_v={:a} {}", model(), microfacet_.alphaU(), microfacet_.alphaV(),
                     interfaceKey());
}

std::string MicrofacetLobe::summary() const {
  const std::string alpha = kind() == LobeKind::isotropic
                                ? fmt::format("α {:.4g}", microfacet_.alphaU())
                                : fmt::format("α {:.4g}×{:.4g}", microfacet_.alphaU(), microfacet_.alphaV());
  return fmt::format("{} {}, {}", microfacet_.name(), alpha, interfaceSummary());
}

double MicrofacetLobe::eval(const Vec3& wo, const Vec3& wi) const {
  double cosHalf = 0.0;
  const double value = microfacet_.reflection(wo, wi, &cosHalf);
  return value > 0.0 ? value * reflectance(cosHalf) : 0.0;
}

std::optional<LobeSample> MicrofacetLobe::sample(const Vec3& wo, const Vec2& u) const {
  const std::optional<Vec3> wi = microfacet_.sampleReflection(wo, u);
  if (!wi) return std::nullopt;
  const float density = pdf(wo, *wi);
  if (!(density > 0.0f)) return std::nullopt;
  return LobeSample{*wi, density};
}

float MicrofacetLobe::pdf(const Vec3& wo, const Vec3& wi) const {
  return static_cast<float>(microfacet_.reflectionPdf(wo, wi));
}

}  // namespace lobe
