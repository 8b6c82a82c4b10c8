#pragma once
// Unconstrained parameters of a mixture for a fit, in whitened coordinates where the lobe has mean 0 and covariance I.
// Covariances are positive definite and weights sum to one by construction.

#include <span>
#include <vector>

#include <Eigen/Core>

#include "runtime/mixture/gaussian.h"

namespace lobe {

/// y = centre + factor·z.
struct Whitening {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  Eigen::Matrix2d factor = Eigen::Matrix2d::Identity();  ///< lower triangular, diagonal > 0

  Eigen::Vector2d inverse(const Eigen::Vector2d& y) const;
};

/// Parameters per component: logarithm of the weight before normalisation, mean (2), log l11, l21, log l22, with
/// Σ = L Lᵀ + kLeastVariance·I in whitened coordinates. The entries of L are clamped to kLargestDeviation.
inline constexpr int kComponentParameters = 6;

/// Lower bound of a variance, relative to the lobe's: prevents spikes between the points of a fit.
inline constexpr double kLeastVariance = 1e-5;

/// Upper bound relative to the lobe's standard deviation: prevents components of vanishing weight from growing.
inline constexpr double kLargestDeviation = 5;

struct WhitenedComponent {
  double weight;
  Eigen::Vector2d mean;
  Eigen::Matrix2d meanSlope;   ///< derivative of the mean with respect to its parameters
  Eigen::Matrix2d lower;       ///< L
  Eigen::Matrix2d lowerSlope;  ///< derivative of each entry of L with respect to its parameter
  Eigen::Matrix2d covariance;  ///< Σ
};

/// Decodes the parameters (softmax for the weights); their number must be a multiple of kComponentParameters.
std::vector<WhitenedComponent> fromParameters(std::span<const double> parameters, const Whitening& whitening);

/// The parameters closest to a mixture over the disc; components of weight 0 get a very small weight.
Eigen::VectorXd toParameters(std::span<const Gaussian> mixture, const Whitening& whitening);

/// The mixture over the disc in single precision, with positive definite covariances.
Mixture toMixture(const std::vector<WhitenedComponent>& components, const Whitening& whitening);

}  // namespace lobe
