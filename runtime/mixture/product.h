#pragma once
// The product of a reflectance mixture and a mixture of light, evaluated lazily (Herholz et al. 2016, Appendix A; right
// form of Eq. 9).
//
// With G1 = constant + Σ a_i N_i (unnormalised reflectance) and G2 = Σ b_j N_j, the product G1·G2 has the mass
//   Z = constant Σ b_j + Σ_ij a_i b_j N(μ_i − μ_j | 0, Σ_i + Σ_j),
// and p(y) = G1(y) G2(y) / Z exactly, so only the chosen pair's mean and covariance are ever formed.

#include <array>

#include "runtime/mixture/disc.h"
#include "runtime/mixture/kernels.h"

namespace lobe {

/// A product of less mass counts as none: its factors' densities would lose digits to underflow.
inline constexpr float kMinMass = 1e-30f;

/// A point of component k of the mixture, from u uniform in [0,1)².
Vec2 sampleLane(const GaussiansView& mixture, int k, const Vec2& u);

/// Chooses a component in proportion to its weight with `choice` uniform in [0,1), then samples it. The weights have a
/// positive sum.
Vec2 sampleGaussians(const GaussiansView& mixture, float choice, const Vec2& u);

/// The product density of one pair of factors. Views the factors; they outlive it. No allocation.
class Product {
 public:
  /// Factors as kernels.h wants them, of at most kMaxReflectanceComponents and kMaxLightComponents components.
  /// constant ≥ 0 is the height of a flat term added to the reflectance.
  Product(const GaussiansView& reflectance, float constant, const GaussiansView& light);

  /// Z; 0 when it is below kMinMass or not finite: then there is no product, and neither sample nor pdf may be called.
  float mass() const { return mass_; }

  /// A point of the plane (perhaps outside the disc) of density pdf.
  Vec2 sample(float choice, const Vec2& u) const;

  /// G1(y)·G2(y)/Z, over the plane's area.
  float pdf(const Vec2& y) const;

 private:
  GaussiansView reflectance_, light_;
  float constant_;
  float mass_ = 0;
  std::array<float, kMaxLightComponents> columns_;  // running sums over the light's components
  /// Masses of all pairs, the light's components fastest; the last row is the constant's.
  std::array<float, std::size_t{kMaxReflectanceComponents + 1} * kMaxLightComponents> pairs_;
};

}  // namespace lobe
