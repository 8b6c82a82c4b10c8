// Rough metals: a microfacet model with the Fresnel reflectance of conductors.

#include <fmt/format.h>

#include "materials/ior.h"
#include "materials/lobes/fresnel.h"
#include "materials/lobes/microfacet_lobe.h"
#include "materials/lobes/roughness.h"
#include "materials/models.h"
#include "materials/reflectance.h"

namespace lobe {
namespace {

Rgb fresnel(const ComplexIor& ior, double cosine) {
  return fresnelConductor(static_cast<float>(cosine), ior.eta, ior.k);
}

class ConductorLobe final : public MicrofacetLobe {
 public:
  ConductorLobe(const Microfacet& microfacet, const ComplexIor& ior) : MicrofacetLobe(microfacet), ior_(ior) {}

 private:
  std::string interfaceName() const override { return "conductor"; }
  std::string interfaceKey() const override {
    return fmt::format("eta={:a},{:a},{:a} k={:a},{:a},{:a}", ior_.eta.x(), ior_.eta.y(), ior_.eta.z(), ior_.k.x(),
                       ior_.k.y(), ior_.k.z());
  }
  std::string interfaceSummary() const override {
    return fmt::format("conductor η {:.4g},{:.4g},{:.4g} k {:.4g},{:.4g},{:.4g}", ior_.eta.x(), ior_.eta.y(),
                       ior_.eta.z(), ior_.k.x(), ior_.k.y(), ior_.k.z());
  }
  double reflectance(double cosHalf) const override { return luminance(fresnel(ior_, cosHalf)); }

  ComplexIor ior_;
};

class RoughConductor final : public Bsdf {
 public:
  RoughConductor(Roughness roughness, const ComplexIor& ior, TexturePtr specular)
      : roughness_(std::move(roughness)), ior_(ior), specular_(std::move(specular)) {
    for (const Microfacet& level : roughness_.levels()) lobes_.push_back(std::make_shared<ConductorLobe>(level, ior));
  }

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    double cosHalf = 0.0;
    const double value = roughness_.at(uv).microfacet.reflection(wo, wi, &cosHalf);
    if (!(value > 0.0)) return Rgb::Zero();
    return static_cast<float>(value) * fresnel(ior_, cosHalf) * specular_->eval(uv);
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float, const Vec2& u) const override {
    const std::optional<Vec3> wi = roughness_.at(uv).microfacet.sampleReflection(wo, u);
    if (!wi) return std::nullopt;
    const float density = pdf(wo, *wi, uv);
    if (!(density > 0.0f)) return std::nullopt;
    return BsdfSample{*wi, eval(wo, *wi, uv), density};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    return static_cast<float>(roughness_.at(uv).microfacet.reflectionPdf(wo, wi));
  }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (wo.z() > 0.0f) addLevels(result, 0, roughness_.at(uv), luminance(specular_->eval(uv)));
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? Rgb(fresnel(ior_, wo.z()) * specular_->eval(uv)) : Rgb::Zero();
  }

 private:
  Roughness roughness_;
  ComplexIor ior_;
  std::vector<LobePtr> lobes_;  ///< one for each roughness level
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makeRoughConductor(const Parameters& parameters) {
  return std::make_shared<RoughConductor>(Roughness::read(parameters), readConductor(parameters),
                                          readReflectance(parameters, {"specular_reflectance", grey(1.0f)}));
}

}  // namespace lobe
