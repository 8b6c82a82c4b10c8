#pragma once
// Internal to materials/: the clear coat of the principled model.

#include <string>

#include "materials/lobe.h"

namespace lobe {

/// F D G, with Burley's distribution of normals GTR1 ("Physically Based Shading at Disney", 2012, equation 4),
/// Schlick's reflectance of 0.04 and Smith's shadowing of GGX for α = 0.25. There is no division by the cosines: in
/// Mitsuba 3, which is followed here, the shadowing does not have them either. Sampled by D cosθ.
class ClearcoatLobe final : public Lobe {
 public:
  /// alpha in (0,1). eta: of the material below, outside to inside; it matters below 1 only, where Schlick's formula
  /// takes the refracted angle.
  ClearcoatLobe(double alpha, double eta) : alpha_(alpha), eta_(eta < 1.0 ? eta : 1.0) {}

  LobeKind kind() const override { return LobeKind::isotropic; }
  std::string model() const override { return "gtr1-clearcoat"; }
  std::string key() const override;
  std::string summary() const override;
  int revision() const override { return 1; }
  double eval(const Vec3& wo, const Vec3& wi) const override;
  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const override;
  float pdf(const Vec3& wo, const Vec3& wi) const override;

 private:
  double density(const Eigen::Vector3d& h) const;

  double alpha_;
  double eta_;
};

}  // namespace lobe
