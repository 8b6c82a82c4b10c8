#pragma once
// A mixture as the free parameters of a fit: in coordinates in which the lobe has mean 0 and covariance I, with
// positive definite covariances and weights that sum to one by construction.

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

/// Of a component: logarithm of its weight before normalisation, mean (2), log l11, l21, log l22, with
/// Σ = L Lᵀ + kLeastVariance·I in whitened coordinates. Beyond kLargestDeviation the entries of L no longer follow.
inline constexpr int kComponentParameters = 6;

/// Of the lobe's own variance: no component is a spike that hides between the points of a fit.
inline constexpr double kLeastVariance = 1e-5;

/// Of the lobe's own deviation: a component that has lost its weight does not grow without end.
inline constexpr double kLargestDeviation = 5;

struct WhitenedComponent {
  double weight;
  Eigen::Vector2d mean;
  Eigen::Matrix2d meanSlope;   ///< of the mean by its parameters
  Eigen::Matrix2d lower;       ///< L
  Eigen::Matrix2d lowerSlope;  ///< of each entry of L by its parameter
  Eigen::Matrix2d covariance;  ///< Σ
};

/// Softmax and the rest; parameters has a multiple of kComponentParameters entries.
std::vector<WhitenedComponent> fromParameters(std::span<const double> parameters, const Whitening& whitening);

/// The nearest parameters of a mixture over the disc; components of weight 0 get a very small one.
Eigen::VectorXd toParameters(std::span<const Gaussian> mixture, const Whitening& whitening);

/// Back to the disc, in single precision, positive definite.
Mixture toMixture(const std::vector<WhitenedComponent>& components, const Whitening& whitening);

}  // namespace lobe
