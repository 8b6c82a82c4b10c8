#pragma once
// How good a mixture is for a lobe's use in a product.

#include <algorithm>
#include <span>
#include <vector>

#include "fitter/lobe_draws.h"
#include "runtime/mixture/gaussian.h"

namespace lobe {

/// The share of BSDF sampling in the density that a fit is graded with.
inline constexpr double kGradedBsdfFraction = 0.1;

/// NEV of one sample for f = ρ cosθ against p = 0.1 q + 0.9 G cosθ / ∫ G cosθ dA, q the lobe's own density: the
/// relative variance of f/p. Samples that the sampler rejects count, with f = 0. 0 where nothing is reflected.
struct Quality {
  /// What the use of a fit is judged by. Each estimate alone may miss what its points miss.
  double worse() const { return std::max(nev, coverage); }

  double nev;       ///< drawn from p
  double coverage;  ///< the same quantity drawn from q, which also sees what the mixture misses
  double worst;     ///< largest f/p of all points visited, in units of ∫ f dω; 0 where nothing is reflected
  Vec3 worstAt;     ///< wi of that point; the normal where nothing is reflected
};

/// Grades any mixture over the disc (weights sum to one) with `samples` points of each density. The points are none of
/// those that fitLobe draws with as many samples.
Quality gradeMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture, std::uint32_t samples);

/// Grades mixtures for one direction, which share the points of q. Keeps a reference to the lobe.
class Grader {
 public:
  /// Throws std::runtime_error as drawLobe.
  Grader(const Lobe& lobe, const Vec3& wo, std::uint32_t samples);

  /// As gradeMixture.
  Quality grade(std::span<const Gaussian> mixture) const;

  /// Quality::coverage alone, for less than half the time.
  double coverage(std::span<const Gaussian> mixture) const;

 private:
  const Lobe& lobe_;
  Vec3 wo_;
  std::uint32_t samples_;
  std::vector<LobeDraw> draws_;
};

}  // namespace lobe
