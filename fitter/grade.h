#pragma once
// Measures how well a mixture fits a lobe, by the variance of sampling with it.

#include <algorithm>
#include <span>
#include <vector>

#include "fitter/lobe_draws.h"
#include "runtime/mixture/gaussian.h"

namespace lobe {

/// The BSDF sampling fraction of the density that a fit is graded with.
inline constexpr double kGradedBsdfFraction = 0.1;

/// The relative variance (NEV) of the one-sample estimator f/p for f = ρ cosθ and p = 0.1 q + 0.9 G cosθ / ∫ G cosθ dA,
/// where q is the density of the lobe's own sampler. Samples that the sampler rejects count as f = 0. All values are 0
/// where nothing is reflected.
struct Quality {
  /// The larger of the two estimates, by which fits are compared: each may miss regions that its points do not sample.
  double largerVariance() const { return std::max(nev, coverage); }

  double nev;       ///< estimated with points drawn from p
  double coverage;  ///< the same quantity estimated with points from q, which also sample what the mixture misses
  double worst;     ///< largest f/p of all points, in units of ∫ f dω; 0 where nothing is reflected
  Vec3 worstAt;     ///< wi of that point; the normal where nothing is reflected
};

/// Grades a mixture over the disc (weights sum to one) with `samples` points of each density. The points differ from
/// those that fitLobe uses with the same number of samples.
Quality gradeMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture, std::uint32_t samples);

/// Grades several mixtures for one direction, reusing the points of q. Keeps a reference to the lobe.
class Grader {
 public:
  /// Throws std::runtime_error like drawLobe.
  Grader(const Lobe& lobe, const Vec3& wo, std::uint32_t samples);

  /// The same as gradeMixture.
  Quality grade(std::span<const Gaussian> mixture) const;

  /// Computes only Quality::coverage, in less than half the time.
  double coverage(std::span<const Gaussian> mixture) const;

 private:
  const Lobe& lobe_;
  Vec3 wo_;
  std::uint32_t samples_;
  std::vector<LobeDraw> draws_;
};

}  // namespace lobe
