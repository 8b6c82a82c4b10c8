// Rough metals: a microfacet distribution of perfect conductors.

#include <array>

#include <fmt/format.h>

#include "materials/fresnel.h"
#include "materials/ior.h"
#include "materials/microfacet_lobe.h"
#include "materials/models.h"

namespace lobe {
namespace {

class ConductorLobe final : public MicrofacetLobe {
 public:
  ConductorLobe(const Microfacet& microfacet, const ComplexIor& ior) : MicrofacetLobe(microfacet), ior_(ior) {}

  Rgb fresnel(double cosHalf) const { return fresnelConductor(static_cast<float>(cosHalf), ior_.eta, ior_.k); }

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
  double reflectance(double cosHalf) const override { return luminance(fresnel(cosHalf)); }

  ComplexIor ior_;
};

class RoughConductor final : public Bsdf {
 public:
  RoughConductor(std::shared_ptr<const ConductorLobe> lobe, TexturePtr specular)
      : lobe_(std::move(lobe)), lobes_{lobe_}, specular_(std::move(specular)) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const override {
    double cosHalf = 0.0;
    const double value = lobe_->microfacet().reflection(wo, wi, &cosHalf);
    if (!(value > 0.0)) return Rgb::Zero();
    return static_cast<float>(value) * lobe_->fresnel(cosHalf) * specular_->eval(uv);
  }

  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float, const Vec2& u) const override {
    const std::optional<LobeSample> drawn = lobe_->sample(wo, u);
    if (!drawn) return std::nullopt;
    return BsdfSample{drawn->wi, eval(wo, drawn->wi, uv), drawn->pdf};
  }

  float pdf(const Vec3& wo, const Vec3& wi, const Vec2&) const override { return lobe_->pdf(wo, wi); }

  std::span<const LobePtr> lobes() const override { return lobes_; }

  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const override {
    LobeMixture result;
    if (!(wo.z() > 0.0f)) return result;
    result.glossy[0] = {0, luminance(specular_->eval(uv))};
    result.glossyCount = 1;
    return result;
  }

  Rgb albedo(const Vec3& wo, const Vec2& uv) const override {
    return wo.z() > 0.0f ? Rgb(lobe_->fresnel(wo.z()) * specular_->eval(uv)) : Rgb::Zero();
  }

 private:
  std::shared_ptr<const ConductorLobe> lobe_;
  std::array<LobePtr, 1> lobes_;
  TexturePtr specular_;
};

}  // namespace

BsdfPtr makeRoughConductor(const Parameters& parameters) {
  auto lobe = std::make_shared<ConductorLobe>(Microfacet::read(parameters), readConductor(parameters));
  return std::make_shared<RoughConductor>(std::move(lobe), parameters.texture("specular_reflectance", grey(1.0f)));
}

}  // namespace lobe
