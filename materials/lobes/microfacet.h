#pragma once
// Microfacet distributions: Beckmann and GGX (Walter et al. 2007), anisotropic, with Smith's shadowing in its separable
// form G1(wo)·G1(wi), and sampling of visible normals.
//
// Local frame, z is the normal; directions point away from the surface. Computed in double precision, and directions
// are made unit in it: the half vector of two grazing floats is otherwise off by a tenth of a narrow lobe's width.

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

  /// D(m): density of normals, ∫ D(m) cosθ_m dm = 1. m is unit; 0 for m.z ≤ 0.
  double density(const Eigen::Vector3d& m) const;

  /// G1(w) / w.z for a unit w with w.z > 0: finite down to grazing, where G1 goes to 0 as w.z does.
  double shadowingOverCosine(const Eigen::Vector3d& w) const;

  /// A normal visible from the unit wo with wo.z > 0, of density G1(wo) max(0, wo·m) D(m) / wo.z; u uniform in [0,1)².
  Eigen::Vector3d sampleVisible(const Eigen::Vector3d& wo, const Vec2& u) const;

  /// D G1(wo) G1(wi) / (4 cosθo cosθi) at the half vector; 0 where either direction is not above the surface.
  /// cosHalf, when given, receives the cosine between wi and the half vector.
  double reflection(const Vec3& wo, const Vec3& wi, double* cosHalf = nullptr) const;

  /// Mirrors wo at a visible normal. nullopt: wo is not above the surface, or its mirror image is not.
  std::optional<Vec3> sampleReflection(const Vec3& wo, const Vec2& u) const;

  /// Density of sampleReflection over solid angle.
  double reflectionPdf(const Vec3& wo, const Vec3& wi) const;

 private:
  Kind kind_;
  double alphaU_;
  double alphaV_;
};

}  // namespace lobe
