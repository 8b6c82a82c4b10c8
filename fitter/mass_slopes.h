#pragma once
// The mass of a Gaussian inside the unit disc, with and without the cosine, and its derivatives, for fits.

#include <Eigen/Core>

namespace lobe {

struct MassSlope {
  double value;
  Eigen::Vector2d byMean;  ///< gradient with respect to the mean
  Eigen::Matrix2d byCov;   ///< symmetric Γ such that d value = tr(Γ dΣ)
};

struct MassSlopes {
  MassSlope inside;  ///< ∫ N dA over the disc
  MassSlope cosine;  ///< ∫ N cosθ dA, cosθ = 1 − |y|²
};

/// The masses of N(mean, factor·factorᵀ); the mean must be inside the disc and factor invertible. Closed form if the
/// Gaussian is far from the edge; otherwise quadrature over the azimuth about the mean, as in discMass but coarser. The
/// error is about 1e-4, and a few percent for the derivatives of elongated Gaussians at the edge, which is accurate
/// enough for the steps of a fit.
MassSlopes massSlopes(const Eigen::Vector2d& mean, const Eigen::Matrix2d& factor);

}  // namespace lobe
