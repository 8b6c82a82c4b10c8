#pragma once
// Fits mixtures by non-linear least squares: Levenberg–Marquardt (Ceres' TinySolver) from a given start.

#include <span>

#include "fitter/fit_residuals.h"
#include "materials/lobe.h"

namespace lobe {

struct NonlinearFitOptions {
  FitObjective objective = FitObjective::product;
  std::uint32_t points = 2048;
  int maxIterations = 30;
  double tolerance = 1e-5;  ///< absolute change of the objective that ends the iteration
};

struct NonlinearFit {
  Mixture mixture;  ///< same number of components as the start; weights sum to one, positive definite
  int iterations = 0;
  double startCost = 0, cost = 0;  ///< the objective on the points of the fit
};

/// Points for a fit for wo, drawn from the lobe's own sampler and, for FitObjective::product, also from `start`, to
/// sample regions where the mixture is too large. Empty where nothing is reflected.
FitPoints fitPoints(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start,
                    const NonlinearFitOptions& options);

/// Improves the start by least squares. Returns the start unchanged if there are fewer points than parameters or if no
/// better mixture is found. Throws std::runtime_error like drawLobe.
NonlinearFit refineMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start,
                           const NonlinearFitOptions& options = {});

}  // namespace lobe
