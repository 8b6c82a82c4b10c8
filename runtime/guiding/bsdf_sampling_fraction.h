#pragma once
// The BSDF sampling fraction of an illumination record, learnt from samples of camera paths: the probability α of BSDF
// sampling that minimises the Kullback–Leibler divergence of α b + (1−α) m from f L cosθ, where b is the density of the
// BSDF's sampler and m that of the mixtures. Müller 2019 ("Practical Path Guiding" in Production) uses gradient
// descent; here α is optimised as a mixture weight by EM, which needs no step size.

#include <span>

#include "runtime/guiding/guided_density.h"

namespace lobe {

/// Lower bound of the fraction, which bounds the sample weights where a mixture fits badly.
inline constexpr float kMinBsdfFraction = 0.05f;

/// A direction sampled at a path vertex. Densities are over solid angle.
struct FractionSample {
  std::size_t record;   ///< index in the cache of the record that serves the vertex
  float bsdf;           ///< density of the BSDF's sampler
  float mixtures;       ///< density of product and illumination together, in the ratio of kProductProbabilities
  float representable;  ///< fraction of samples to which α applies, in (0,1]; the others always use the BSDF
  float weight = 0;     ///< f L cosθ (luminance) divided by the density that the direction was sampled with
};

class BsdfSamplingFraction {
 public:
  /// Updates the fraction with the samples of a pass. Samples whose weight is not positive, or whose weight or
  /// densities are not finite, are ignored. The result is invariant to scaling all weights of a pass.
  void learn(std::span<const FractionSample> samples);

  /// The fraction, in [kMinBsdfFraction, 1 − kMinBsdfFraction]; kProductProbabilities.bsdf before the first update.
  float bsdf() const { return bsdf_; }

 private:
  double bsdfEvidence_ = 0, evidence_ = 0;  // effective samples: attributed to the BSDF, and in total
  float bsdf_ = kProductProbabilities.bsdf;
};

}  // namespace lobe
