#pragma once
// A bivariate Gaussian in the plane of the disc, and small mixtures of them. Densities are over the plane's area (dA).

#include <cmath>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "runtime/mixture/disc.h"

namespace lobe {

/// A symmetric 2×2 matrix. Plain data: stored in caches as it is.
struct Covariance {
  float xx, xy, yy;
  /// In double, where both products are exact: for long thin lobes nearly all of their digits cancel.
  float determinant() const { return static_cast<float>(static_cast<double>(xx) * yy - static_cast<double>(xy) * xy); }
};

/// One weighted component. weight ≥ 0; covariance positive definite. Plain data: stored in caches as it is.
struct Gaussian {
  float weight;
  float meanX, meanY;
  Covariance cov;
  Vec2 mean() const { return {meanX, meanY}; }
};
static_assert(sizeof(Gaussian) == 24);

/// A mixture owns its components; where only reading is needed a std::span<const Gaussian> is passed.
using Mixture = std::vector<Gaussian>;

/// N(y | mean, cov) without the weight. 0 where it underflows; never NaN for a positive definite covariance.
float normalPdf(const Gaussian& g, const Vec2& y);

/// Σ weight · N: the weights need not sum to one.
float mixturePdf(std::span<const Gaussian> mixture, const Vec2& y);

/// A point of N(mean, cov) from u uniform in [0,1)² (Box–Muller and the Cholesky factor).
Vec2 sampleNormal(const Gaussian& g, const Vec2& u);

/// Chooses a component in proportion to its weight with `choice` uniform in [0,1), then samples it. The mixture is not
/// empty and its weights have a positive sum.
Vec2 sampleMixture(std::span<const Gaussian> mixture, float choice, const Vec2& u);

/// The mixture turned about the disc's centre by the angle of the unit vector (cos, sin): μ' = Rμ, Σ' = RΣRᵀ.
Gaussian rotated(const Gaussian& g, const Vec2& direction);

/// The moment-preserving merge of two components (Herholz et al. 2016, Appendix B).
Gaussian merged(const Gaussian& a, const Gaussian& b);

/// Runnalls' cost of that merge (right form of Eq. 10): ½[(π_i+π_j) log|Σ_ij| − π_i log|Σ_i| − π_j log|Σ_j|] ≥ 0.
float mergeCost(const Gaussian& a, const Gaussian& b);

/// Merges the cheapest pair while the running sum of costs stays ≤ threshold; returns the sum spent.
float reduce(Mixture& mixture, float threshold);

}  // namespace lobe
