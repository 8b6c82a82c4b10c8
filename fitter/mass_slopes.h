#pragma once
// A Gaussian's mass on the disc, with and without the cosine, and how it changes with mean and covariance: for fits.

#include <Eigen/Core>

namespace lobe {

struct MassSlope {
  double value;
  Eigen::Vector2d byMean;  ///< the gradient
  Eigen::Matrix2d byCov;   ///< symmetric Γ: the change is tr(Γ dΣ)
};

struct MassSlopes {
  MassSlope inside;  ///< ∫ N dA over the disc
  MassSlope cosine;  ///< ∫ N cosθ dA, cosθ = 1 − |y|²
};

/// Of N(mean, factor·factorᵀ), mean in the disc, factor invertible. In closed form where the Gaussian keeps clear of
/// the edge; else by quadrature over the azimuth about the mean with the radius in closed form, as discMass but
/// coarser: to about 1e-4, the slopes of long thin Gaussians at the very edge to some percent. Enough for the steps of
/// a fit.
MassSlopes massSlopes(const Eigen::Vector2d& mean, const Eigen::Matrix2d& factor);

}  // namespace lobe
