#pragma once
// The residuals that fits of a lobe by least squares make small, with analytic derivatives.

#include <vector>

#include <Eigen/Core>

#include "fitter/whitened_mixture.h"

namespace lobe {

/// What a mixture is fitted for.
enum class FitObjective {
  /// The use in a product: χ² = ∫ (f − p)²/p dA over the disc with f = ρ cosθ / ∫ρ cosθ dA and
  /// p = 0.1 q + 0.9 G cosθ / ∫G cosθ dA, q the density of the lobe's sampler. Its value is the NEV of p, to which a
  /// small penalty is added for the square of G's share outside the disc, which costs nothing else here.
  product,
  /// ∫ (1 − ρ̂/G)² q dA with ρ̂ = ρ/∫ρ dA: Herholz et al. 2016, Eq. 8, in one measure.
  reflectance,
};

/// The points of a fit, all densities over the disc's area.
struct FitPoints {
  Whitening whitening;
  Eigen::ArrayXd x, y;    ///< whitened
  Eigen::ArrayXd target;  ///< f or ρ̂
  Eigen::ArrayXd ownPdf;  ///< q
  Eigen::ArrayXd cosine;
  Eigen::ArrayXd weight;  ///< of the quadrature: Σ weight·h is ∫ h dA (product) or ∫ h q dA (reflectance)
  Eigen::Index size() const { return x.size(); }
};

/// In the form that Ceres' TinySolver takes. Keeps a reference to the points.
class FitResiduals {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = Eigen::Dynamic };

  FitResiduals(FitObjective objective, const FitPoints& points, std::size_t components)
      : objective_(objective), points_(points), components_(static_cast<int>(components)) {}

  int NumResiduals() const { return static_cast<int>(points_.size()) + (objective_ == FitObjective::product ? 1 : 0); }
  int NumParameters() const { return kComponentParameters * components_; }

  /// jacobian: column-major, a row a residual; may be null. Always true.
  bool operator()(const double* parameters, double* residuals, double* jacobian) const;

 private:
  FitObjective objective_;
  const FitPoints& points_;
  int components_;
};

}  // namespace lobe
