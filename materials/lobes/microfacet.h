#pragma once
// Microfacet distributions: Beckmann and GGX (Walter et al. 2007), anisotropic, with Smith's shadowing in its separable
// form G1(wo)·G1(wi), and sampling of visible normals.
//
// Directions are in the local frame, in which z is the normal, and point away from the surface. They are normalised,
// and everything is computed, in double precision: in single precision the half vector of two grazing directions would
// be off by a tenth of the width of a narrow lobe.

#include <optional>
#include <string_view>

#include "runtime/core/vec.h"

namespace lobe {

class Microfacet {
 public:
  enum class Kind { beckmann, ggx };

  /// alphaU and alphaV > 0: roughness along local x and y.
  Microfacet(Kind kind, double alphaU, double alphaV) : kind_(kind), alphaU_(alphaU), alphaV_(alphaV) {}

  Kind kind() const { return kind_; }
  double alphaU() const { return alphaU_; }
  double alphaV() const { return alphaV_; }
  std::string_view name() const { return kind_ == Kind::ggx ? "ggx" : "beckmann"; }

  /// D(m), the distribution of normals, with ∫ D(m) cosθ_m dm = 1, for a unit vector m; 0 for m.z ≤ 0.
  double density(const Eigen::Vector3d& m) const;

  /// G1(w) / w.z for a unit vector w with w.z > 0. It is finite at grazing angles, where G1 is proportional to w.z.
  double shadowingOverCosine(const Eigen::Vector3d& w) const;

  /// Samples a normal visible from the unit vector wo, wo.z > 0, with density G1(wo) max(0, wo·m) D(m) / wo.z; u is
  /// uniform in [0,1)².
  Eigen::Vector3d sampleVisible(const Eigen::Vector3d& wo, const Vec2& u) const;

  /// D G1(wo) G1(wi) / (4 cosθo cosθi) at the half vector; 0 if either direction is not above the surface.
  /// cosHalf, if not null, receives the cosine between wi and the half vector.
  double reflection(const Vec3& wo, const Vec3& wi, double* cosHalf = nullptr) const;

  /// Reflects wo at a sampled visible normal. nullopt: wo or the reflected direction is not above the surface.
  std::optional<Vec3> sampleReflection(const Vec3& wo, const Vec2& u) const;

  /// Density of sampleReflection over solid angle.
  double reflectionPdf(const Vec3& wo, const Vec3& wi) const;

 private:
  Kind kind_;
  double alphaU_;
  double alphaV_;
};

}  // namespace lobe
