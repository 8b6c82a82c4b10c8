#pragma once
// The sampling density of directions at one path vertex: a one-sample mixture of three strategies (product, BSDF,
// illumination).
//
// The product is a sum of two terms. The term of the illumination's background component is proportional to ρ cosθ and
// is left to the BSDF's own sampler; the term of the Gaussians is sampled in closed form. The density is therefore
//   p(ω) = bsdfFraction · p_bsdf(ω) + guidedPdf(ω).
// Frame: a local frame with z on the side of wo, in whose disc both reflectance and illumination are given. All
// densities are over solid angle.

#include <optional>

#include "lobe/surface_distribution.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/reflectance.h"
#include "runtime/mixture/product.h"

namespace lobe {

/// The probabilities of the strategies: non-negative, with sum 1. bsdf > 0, so that estimates are unbiased.
struct StrategyProbabilities {
  float product, bsdf, illumination;
};

/// Chosen by measurement (scripts/bench-vertices): a larger probability of the product makes the worst vertices worse
/// without improving the median; a smaller one makes the median worse.
inline constexpr StrategyProbabilities kProductProbabilities{0.70f, 0.20f, 0.10f};
/// The same ratio of product to illumination with another BSDF sampling fraction, in (0,1).
inline StrategyProbabilities productProbabilities(float bsdf) {
  const float rest = (1 - bsdf) / (kProductProbabilities.product + kProductProbabilities.illumination);
  return {rest * kProductProbabilities.product, bsdf, rest * kProductProbabilities.illumination};
}
/// Illumination and BSDF with probability ½ each, as in Vorba et al. 2014.
inline constexpr StrategyProbabilities kGuidedProbabilities{0.0f, 0.5f, 0.5f};

class GuidedDensity {
 public:
  /// Keeps references to both factors, which must outlive it. If the product has no mass, its probability is added to
  /// that of the BSDF.
  GuidedDensity(const Reflectance& reflectance, const PackedRecord& illumination,
                const StrategyProbabilities& probabilities);

  /// ∫ ρ p_L dA: the reflected radiance per unit of irradiance; 0 if probabilities.product is 0.
  float reflected() const { return reflected_; }

  /// The probability of Strategy::bsdf, which includes the background term of the product.
  float bsdfFraction() const { return bsdfFraction_; }

  /// The probability of Strategy::product given that the strategy is not Strategy::bsdf.
  float productOfGuided() const {
    const float guided = productFraction_ + illuminationFraction_;
    return guided > 0 ? productFraction_ / guided : 0;
  }

  /// Chooses a strategy with `choice` uniform in [0,1), and rescales `choice` to be uniform in [0,1) again.
  Strategy choose(float& choice) const { return detail::chooseStrategy(choice, bsdfFraction_, productOfGuided()); }

  /// Samples a local direction from the product or the illumination. nullopt, for a point outside the disc, is a sample
  /// of value zero.
  std::optional<Vec3> sample(Strategy strategy, float choice, const Vec2& u) const;

  /// The density of choosing the product or the illumination and sampling wi with it; 0 for wi.z ≤ 0.
  float guidedPdf(const Vec3& wi) const;

 private:
  const Reflectance& reflectance_;
  const PackedRecord& illumination_;
  std::optional<Product> product_;
  float bsdfFraction_;
  float reflected_ = 0;
  float productFraction_ = 0;  // probability of sampling the product's Gaussian term
  float illuminationFraction_;
  float productScale_ = 0;  // productFraction_ / mass of the product
};

}  // namespace lobe
