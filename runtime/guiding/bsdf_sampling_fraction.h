#pragma once
// How often a record leaves the choice of a direction to the BSDF, learnt from what camera paths found: the share α
// that brings α b + (1−α) m nearest to f L cosθ by Kullback–Leibler divergence, with b the BSDF's density and m that of
// the mixtures. Müller 2019 ("Practical Path Guiding" in Production) descends the gradient in α; α is a weight of a
// mixture, for which EM needs no step size.

#include <span>

#include "runtime/guiding/guided_density.h"

namespace lobe {

/// Of the BSDF at least, so that what a bad mixture does is bounded.
inline constexpr float kMinBsdfFraction = 0.05f;

/// One direction that a path took at a vertex. Densities over solid angle.
struct FractionSample {
  std::size_t record;   ///< that served the vertex: its index in the cache
  float bsdf;           ///< the BSDF's density of the direction
  float mixtures;       ///< that of product and illumination, in the ratio of kProductProbabilities
  float representable;  ///< share of samples that BSDF and mixtures divide; the others are the BSDF's; in (0,1]
  float weight = 0;     ///< f L cosθ over the density that it was drawn by, luminance
};

class BsdfSamplingFraction {
 public:
  /// Adds the samples of a pass to what was learnt before. Those whose weight or densities are not positive and finite
  /// are ignored; scaling all weights of a pass changes nothing.
  void learn(std::span<const FractionSample> samples);

  /// In [kMinBsdfFraction, 1 − kMinBsdfFraction]; kProductProbabilities.bsdf before anything was learnt.
  float bsdf() const { return bsdf_; }

 private:
  double bsdfEvidence_ = 0, evidence_ = 0;  // in effective samples: the BSDF's, and both
  float bsdf_ = kProductProbabilities.bsdf;
};

}  // namespace lobe
