#pragma once
// The product of a reflectance mixture and an illumination mixture, evaluated lazily (Herholz et al. 2016, Appendix A,
// and Eq. 9, corrected).
//
// With G1 = constant + Σ a_i N_i (unnormalised reflectance) and G2 = Σ b_j N_j, the product G1·G2 has the mass
//   Z = constant Σ b_j + Σ_ij a_i b_j N(μ_i − μ_j | 0, Σ_i + Σ_j),
// and p(y) = G1(y) G2(y) / Z holds exactly, so that mean and covariance are needed for the sampled pair only.

#include <array>

#include "runtime/mixture/disc.h"
#include "runtime/mixture/kernels.h"

namespace lobe {

/// A product with less mass is treated as empty, because densities of its factors would lose precision by underflow.
inline constexpr float kMinMass = 1e-30f;

/// Samples component k of the mixture with u uniform in [0,1)².
Vec2 sampleLane(const GaussiansView& mixture, int k, const Vec2& u);

/// Chooses a component in proportion to its weight with `choice` uniform in [0,1), then samples it. The sum of the
/// weights must be positive.
Vec2 sampleGaussians(const GaussiansView& mixture, float choice, const Vec2& u);

/// The density proportional to the product of two factors. Views the factors, which must outlive it. Does not allocate.
class Product {
 public:
  /// Factors as required by kernels.h, with up to kMaxReflectanceComponents and kMaxLightComponents components.
  /// constant ≥ 0 is added to the reflectance.
  Product(const GaussiansView& reflectance, float constant, const GaussiansView& light);

  /// Z, or 0 if it is below kMinMass or not finite; sample and pdf must not be called then.
  float mass() const { return mass_; }

  /// Samples a point of the plane with density pdf; it may lie outside the disc.
  Vec2 sample(float choice, const Vec2& u) const;

  /// The density G1(y)·G2(y)/Z over the plane's area.
  float pdf(const Vec2& y) const;

 private:
  GaussiansView reflectance_, light_;
  float constant_;
  float mass_ = 0;
  std::array<float, kMaxLightComponents> columns_;  // running sums over the light's components
  /// Masses of all pairs in rows of the light's components; the last row belongs to the constant.
  std::array<float, std::size_t{kMaxReflectanceComponents + 1} * kMaxLightComponents> pairs_;
};

}  // namespace lobe
