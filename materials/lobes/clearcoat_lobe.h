#pragma once
// Internal to materials/: the clear coat of the principled model.

#include <string>

#include "materials/lobe.h"

namespace lobe {

/// F D G with Burley's GTR1 distribution of normals ("Physically Based Shading at Disney", 2012, equation 4), Schlick's
/// approximation with 0.04 at normal incidence, and Smith's shadowing of GGX with α = 0.25. As in Mitsuba 3, it is not
/// divided by the cosines. Half vectors are sampled with density D cosθ.
class ClearcoatLobe final : public Lobe {
 public:
  /// alpha is in (0,1). eta: index of the material below over that of the outside; it matters only if it is below 1, in
  /// which case Schlick's formula uses the refracted angle.
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
