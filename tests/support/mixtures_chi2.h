#pragma once
// The χ² test of the mixtures of a guided density.

#include "runtime/core/random.h"
#include "runtime/guiding/guided_density.h"
#include "tests/support/chi2.h"

namespace lobe::test {

/// Tests the part of the density that is not BSDF sampling. mutant: a factor on the density; values other than 1 must
/// fail the test.
inline Chi2Result ofMixtures(const GuidedDensity& density, std::uint64_t stream, const Chi2Options& options = {},
                             float mutant = 1) {
  Rng rng(32, stream);
  const auto draw = [&]() -> std::optional<Vec3> {
    // The part of [0,1) above the BSDF sampling fraction.
    float choice = std::min(density.bsdfFraction() + (1 - density.bsdfFraction()) * rng.uniform(), 0x1.fffffep-1f);
    const Strategy strategy = density.choose(choice);
    if (strategy == Strategy::bsdf) return std::nullopt;
    return density.sample(strategy, choice, rng.uniform2());
  };
  const float scale = mutant / (1 - density.bsdfFraction());
  return chi2Sphere(
      draw, [&](const Vec3& wi) { return scale * density.guidedPdf(wi); }, options);
}

}  // namespace lobe::test
