#pragma once
// The fit as it is made without thought, to be compared with: Eq. 8 of Herholz et al. 2016, automatic derivatives, QR.

#include <span>

#include "fitter/fit_residuals.h"

namespace lobe {

/// The start refined by ceres::Solve as it stops by default, on one thread. points: for FitObjective::reflectance. The
/// parameters are those of refineMixture. The start has 1, 2, 4 or 8 components; else std::runtime_error.
Mixture refineAutomatically(const FitPoints& points, std::span<const Gaussian> start);

}  // namespace lobe
