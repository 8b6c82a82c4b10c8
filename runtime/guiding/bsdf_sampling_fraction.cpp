#include "runtime/guiding/bsdf_sampling_fraction.h"

#include <algorithm>
#include <cmath>

namespace lobe {
namespace {

// The weight of the initial fraction, in effective samples. Its value is not critical: with 3, or with earlier passes
// counted half, the errors of images are the same within their noise.
constexpr double kPriorEvidence = 10;
constexpr int kSweeps = 60;

bool counts(const FractionSample& s) {
  return s.weight > 0 && std::isfinite(s.weight) && std::isfinite(s.bsdf) && std::isfinite(s.mixtures) &&
         s.bsdf + s.mixtures > 0;
}

/// The factor that makes the weights sum to the effective number of samples, (Σw)²/Σw²; 0 if no sample counts.
double toEffectiveSamples(std::span<const FractionSample> samples) {
  double sum = 0, squares = 0;
  for (const FractionSample& s : samples) {
    if (!counts(s)) continue;
    sum += s.weight;
    squares += static_cast<double>(s.weight) * s.weight;
  }
  return squares > 0 ? sum / squares : 0;
}

}  // namespace

void BsdfSamplingFraction::learn(std::span<const FractionSample> samples) {
  const double scale = toEffectiveSamples(samples);
  if (!(scale > 0)) return;
  double bsdfEvidence = 0, evidence = 0;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bsdfEvidence = bsdfEvidence_;
    evidence = evidence_;
    for (const FractionSample& s : samples) {
      if (!counts(s)) continue;
      const double bsdf = s.representable * bsdf_ * s.bsdf, mixtures = s.representable * (1 - bsdf_) * s.mixtures;
      const double each = scale * s.weight / (bsdf + mixtures + (1 - s.representable) * s.bsdf);
      bsdfEvidence += each * bsdf;
      evidence += each * (bsdf + mixtures);
    }
    const double fraction = (bsdfEvidence + kPriorEvidence * kProductProbabilities.bsdf) / (evidence + kPriorEvidence);
    bsdf_ = static_cast<float>(std::clamp<double>(fraction, kMinBsdfFraction, 1 - kMinBsdfFraction));
  }
  bsdfEvidence_ = bsdfEvidence;
  evidence_ = evidence;
}

}  // namespace lobe
