#pragma once
// Residuals of the least-squares fit of a lobe, with analytic derivatives.

#include <vector>

#include <Eigen/Core>

#include "fitter/whitened_mixture.h"

namespace lobe {

/// The objective that a fit minimises.
enum class FitObjective {
  /// Variance when sampling the product: χ² = ∫ (f − p)²/p dA over the disc with f = ρ cosθ / ∫ρ cosθ dA and
  /// p = 0.1 q + 0.9 G cosθ / ∫G cosθ dA, q the density of the lobe's sampler. This is the relative variance (NEV) of
  /// sampling f with p. A small penalty is added for the square of G's mass outside the disc, which does not affect p.
  product,
  /// ∫ (1 − ρ̂/G)² q dA with ρ̂ = ρ/∫ρ dA: Herholz et al. 2016, Eq. 8, with both densities in the measure of the disc.
  reflectance,
};

/// Sample points of a fit; all densities are with respect to area on the disc.
struct FitPoints {
  Whitening whitening;
  Eigen::ArrayXd x, y;    ///< whitened
  Eigen::ArrayXd target;  ///< f or ρ̂
  Eigen::ArrayXd ownPdf;  ///< q
  Eigen::ArrayXd cosine;
  Eigen::ArrayXd weight;  ///< quadrature weight: Σ weight·h ≈ ∫ h dA (product) or ∫ h q dA (reflectance)
  Eigen::Index size() const { return x.size(); }
};

/// Residual functor for Ceres' TinySolver. Keeps a reference to the points.
class FitResiduals {
 public:
  // Names that TinySolver asks for.
  // NOLINTBEGIN(readability-identifier-naming)
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = Eigen::Dynamic };
  // NOLINTEND(readability-identifier-naming)

  FitResiduals(FitObjective objective, const FitPoints& points, std::size_t components)
      : objective_(objective), points_(points), components_(static_cast<int>(components)) {}

  // NOLINTBEGIN(readability-identifier-naming)
  int NumResiduals() const { return static_cast<int>(points_.size()) + (objective_ == FitObjective::product ? 1 : 0); }
  int NumParameters() const { return kComponentParameters * components_; }
  // NOLINTEND(readability-identifier-naming)

  /// jacobian is column-major with one row per residual, and may be null. Always returns true.
  bool operator()(const double* parameters, double* residuals, double* jacobian) const;

 private:
  FitObjective objective_;
  const FitPoints& points_;
  int components_;
};

}  // namespace lobe
