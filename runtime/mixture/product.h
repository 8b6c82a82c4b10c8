#pragma once
// The product of a reflectance mixture and an illumination mixture, evaluated lazily (Herholz et al. 2016, Appendix A;
// right form of Eq. 9). Scalar reference form.
//
// With G1 = constant + Σ a_i N_i (unnormalised reflectance) and G2 = Σ b_j N_j, the product G1·G2 has the mass
//   Z = constant Σ b_j + Σ_ij a_i b_j N(μ_i − μ_j | 0, Σ_i + Σ_j),
// and p(y) = G1(y) G2(y) / Z exactly, so only the chosen pair's mean and covariance are ever formed.

#include <array>
#include <span>

#include "runtime/mixture/gaussian.h"

namespace lobe {

/// Largest component counts of the two factors; more is refused when a cache or record is made.
inline constexpr int kMaxReflectanceComponents = 32;
inline constexpr int kMaxIlluminationComponents = 16;

/// A product of less mass counts as none: its factors' densities would lose digits to underflow.
inline constexpr float kMinMass = 1e-30f;

/// The product density of one pair of factors. Views the factors; they outlive it. No allocation.
class Product {
 public:
  /// constant ≥ 0 is the height of a flat term added to the reflectance. Throws if a factor has too many components.
  Product(std::span<const Gaussian> reflectance, float constant, std::span<const Gaussian> illumination);

  /// Z; 0 when it is below kMinMass or not finite: then there is no product, and neither sample nor pdf may be called.
  float mass() const { return mass_; }

  /// A point of the plane (perhaps outside the disc) of density pdf.
  Vec2 sample(float choice, const Vec2& u) const;

  /// G1(y)·G2(y)/Z, over the plane's area.
  float pdf(const Vec2& y) const;

 private:
  std::span<const Gaussian> reflectance_;
  std::span<const Gaussian> illumination_;
  float constant_;
  float mass_ = 0;
  /// Weights of all pairs, illumination fastest (K2·k1 + k2); the last row is the constant's.
  std::array<float, std::size_t{kMaxReflectanceComponents + 1} * kMaxIlluminationComponents> pairs_;
};

}  // namespace lobe
