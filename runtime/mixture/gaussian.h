#pragma once
// Bivariate Gaussians in the plane of the disc, and mixtures of them. Densities are with respect to area (dA).

#include <cmath>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "runtime/mixture/disc.h"

namespace lobe {

/// A symmetric 2×2 matrix. Plain data with the layout of the cache files.
struct Covariance {
  float xx, xy, yy;
  /// Computed in double precision, in which both products are exact, because they nearly cancel for elongated
  /// Gaussians.
  float determinant() const { return static_cast<float>(static_cast<double>(xx) * yy - static_cast<double>(xy) * xy); }
};

/// A weighted component: weight ≥ 0, covariance positive definite. Plain data with the layout of the cache files.
struct Gaussian {
  float weight;
  float meanX, meanY;
  Covariance cov;
  Vec2 mean() const { return {meanX, meanY}; }
};
static_assert(sizeof(Gaussian) == 24);

/// An owning mixture. Functions that only read one take a std::span<const Gaussian>.
using Mixture = std::vector<Gaussian>;

/// N(y | mean, cov), without the weight. 0 on underflow; never NaN for a positive definite covariance.
float normalPdf(const Gaussian& g, const Vec2& y);

/// Σ weight · N(y). The weights need not sum to one.
float mixturePdf(std::span<const Gaussian> mixture, const Vec2& y);

/// Samples N(mean, cov) with u uniform in [0,1)² (Box–Muller transform and Cholesky factor).
Vec2 sampleNormal(const Gaussian& g, const Vec2& u);

/// Chooses a component in proportion to its weight with `choice` uniform in [0,1), then samples it. The sum of the
/// weights must be positive.
Vec2 sampleMixture(std::span<const Gaussian> mixture, float choice, const Vec2& u);

/// The Gaussian rotated about the disc's centre by the angle of the unit vector (cos, sin): μ' = Rμ, Σ' = RΣRᵀ.
Gaussian rotated(const Gaussian& g, const Vec2& direction);

/// The moment-preserving merge of two components (Herholz et al. 2016, Appendix B).
Gaussian merged(const Gaussian& a, const Gaussian& b);

/// Runnalls' cost of that merge, ½[(π_i+π_j) log|Σ_ij| − π_i log|Σ_i| − π_j log|Σ_j|] ≥ 0 (Herholz et al. 2016, Eq. 10,
/// corrected).
float mergeCost(const Gaussian& a, const Gaussian& b);

/// Merges the cheapest pair of components repeatedly while the sum of the costs stays ≤ threshold; returns that sum.
float reduce(Mixture& mixture, float threshold);

}  // namespace lobe
