#pragma once
// Mixtures of a lobe by non-linear least squares: Levenberg–Marquardt (Ceres' TinySolver) from a start that is given.

#include <span>

#include "fitter/fit_residuals.h"
#include "materials/lobe.h"

namespace lobe {

struct NonlinearFitOptions {
  FitObjective objective = FitObjective::product;
  std::uint32_t points = 2048;
  int maxIterations = 30;
  double tolerance = 1e-5;  ///< absolute, of the objective, that ends the iteration
};

struct NonlinearFit {
  Mixture mixture;  ///< as many components as the start; weights sum to one, positive definite
  int iterations = 0;
  double startCost = 0, cost = 0;  ///< the objective, on the points of the fit
};

/// Points for a fit for wo: of the lobe's own sampler and, for the product, of `start` as well, so that what the
/// mixture has too much of is seen. Empty where nothing is reflected.
FitPoints fitPoints(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start,
                    const NonlinearFitOptions& options);

/// The start, made better. Returned as it is where the lobe has too few points for its parameters, or when nothing
/// better is found. Throws std::runtime_error as drawLobe.
NonlinearFit refineMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> start,
                           const NonlinearFitOptions& options = {});

}  // namespace lobe
