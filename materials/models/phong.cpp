// The modified Phong model (Lafortune and Willems 1994, "Using the Modified Phong Reflectance Model for Physically
// Based Rendering"): a power of the cosine to the mirror direction plus a Lambertian term. It is reciprocal, and
// conserves energy if the sum of its two colours does not exceed 1.

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "materials/lobes/lobe_on_diffuse.h"
#include "materials/models.h"
#include "materials/reflectance.h"
#include "runtime/core/frame.h"

namespace lobe {
namespace {

Vec3 mirrored(const Vec3& w) {
  return {-w.x(), -w.y(), w.z()};
}

/// (n + 2) / 2π · cosⁿα, where α is the angle between wi and the mirror direction of wo.
class PhongLobe final : public Lobe {
 public:
  explicit PhongLobe(double exponent) : exponent_(exponent) {}

  LobeKind kind() const override { return LobeKind::isotropic; }
  std::string model() const override { return "phong"; }
  std::string key() const override { return fmt::format("phong exponent={:a}", exponent_); }
  std::string summary() const override { return fmt::format("phong, exponent {:.4g}", exponent_); }
  int revision() const override { return 1; }

  double eval(const Vec3& wo, const Vec3& wi) const override { return (exponent_ + 2.0) * power(wo, wi); }

  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const override {
    if (!(wo.z() > 0.0f)) return std::nullopt;
    // cos α = u^(1/(n+1)). For large n the cosine rounds to 1, so the sine is computed from its logarithm by expm1.
    const double logCosine = std::log(1.0 - static_cast<double>(u.x())) / (exponent_ + 1.0);
    const double cosine = std::exp(logCosine);
    const double sine = std::sqrt(-std::expm1(2.0 * logCosine));
    const double phi = 2.0 * std::numbers::pi * static_cast<double>(u.y());
    const Vec3 local = Eigen::Vector3d(sine * std::cos(phi), sine * std::sin(phi), cosine).cast<float>();
    const Vec3 wi = Frame::fromNormal(mirrored(wo)).toWorld(local).normalized();
    const float density = pdf(wo, wi);
    if (!(density > 0.0f)) return std::nullopt;
    return LobeSample{wi, density};
  }

  float pdf(const Vec3& wo, const Vec3& wi) const override {
    return static_cast<float>((exponent_ + 1.0) * power(wo, wi));
  }

 private:
  /// cosⁿα / 2π; 0 if either direction is not above the surface.
  double power(const Vec3& wo, const Vec3& wi) const {
    if (!(wo.z() > 0.0f && wi.z() > 0.0f)) return 0.0;
    const double cosine = mirrored(wo).cast<double>().normalized().dot(wi.cast<double>().normalized());
    return cosine > 0.0 ? std::pow(std::min(cosine, 1.0), exponent_) / (2.0 * std::numbers::pi) : 0.0;
  }

  double exponent_;
};

}  // namespace

BsdfPtr makePhong(const Parameters& parameters) {
  const double exponent = parameters.number("exponent", 30.0);
  if (!(exponent >= 0.0 && exponent <= 1e7))
    throw ParameterError("exponent", fmt::format("exponent must be in [0, 1e7], not {}", exponent));
  auto [specular, diffuse] =
      readReflectances(parameters, {"specular_reflectance", grey(0.2f)}, {"diffuse_reflectance", grey(0.5f)});
  return std::make_shared<LobeOnDiffuse>(std::make_shared<PhongLobe>(exponent), std::move(specular),
                                         std::move(diffuse));
}

}  // namespace lobe
