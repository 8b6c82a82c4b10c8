#pragma once
// The density of directions at one vertex: a one-sample mixture of three strategies (product, BSDF, illumination).
//
// The product has two terms: that of the illumination's background component is exactly ρ cosθ, which the BSDF's own
// sampler samples; that of the Gaussians is sampled in closed form. So the density is
//   p(ω) = bsdfFraction · p_bsdf(ω) + guidedPdf(ω),
// and choosing between them is all the caller has to do. Frame: the disc of a local frame with z on the side of wo, in
// which reflectance and illumination are both given. Densities are over solid angle.

#include <optional>

#include "lobe/surface_distribution.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/reflectance.h"
#include "runtime/mixture/product.h"

namespace lobe {

/// How often each strategy is chosen; non-negative, sum 1, bsdf > 0 so that the whole hemisphere is covered.
struct StrategyProbabilities {
  float product, bsdf, illumination;
};

/// Measured (scripts/bench-vertices): with more of the product the worst vertices get worse and the median no better;
/// with less the median gets worse.
inline constexpr StrategyProbabilities kProductProbabilities{0.70f, 0.20f, 0.10f};
/// The same with another share of the BSDF, in (0,1); the mixtures keep their ratio.
inline StrategyProbabilities productProbabilities(float bsdf) {
  const float rest = (1 - bsdf) / (kProductProbabilities.product + kProductProbabilities.illumination);
  return {rest * kProductProbabilities.product, bsdf, rest * kProductProbabilities.illumination};
}
/// Vorba et al. 2014.
inline constexpr StrategyProbabilities kGuidedProbabilities{0.0f, 0.5f, 0.5f};

class GuidedDensity {
 public:
  /// Views both; they outlive it. Where the product has no mass its share goes to the BSDF.
  GuidedDensity(const Reflectance& reflectance, const PackedRecord& illumination,
                const StrategyProbabilities& probabilities);

  /// ∫ ρ p_L dA, what the reflectance given makes of one unit of irradiance; 0 without a product (shares.product 0).
  float reflected() const { return reflected_; }

  /// The probability of Strategy::bsdf.
  float bsdfFraction() const { return bsdfFraction_; }

  /// The probability of Strategy::product among the strategies other than the BSDF's.
  float productOfGuided() const {
    const float guided = productFraction_ + illuminationFraction_;
    return guided > 0 ? productFraction_ / guided : 0;
  }

  /// Chooses with `choice` uniform in [0,1), which is made uniform again for the strategy chosen.
  Strategy choose(float& choice) const { return detail::chooseStrategy(choice, bsdfFraction_, productOfGuided()); }

  /// A local direction of the product or the illumination. nullopt: outside the disc, a sample of value zero.
  std::optional<Vec3> sample(Strategy strategy, float choice, const Vec2& u) const;

  /// The density of choosing and sampling product or illumination; 0 for wi.z ≤ 0.
  float guidedPdf(const Vec3& wi) const;

 private:
  const Reflectance& reflectance_;
  const PackedRecord& illumination_;
  std::optional<Product> product_;
  float bsdfFraction_;
  float reflected_ = 0;
  float productFraction_ = 0;  // of the product's Gaussian term
  float illuminationFraction_;
  float productScale_ = 0;  // productFraction_ / mass of the product
};

}  // namespace lobe
