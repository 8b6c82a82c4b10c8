#pragma once
// The baseline of the fit: Eq. 8 of Herholz et al. 2016, minimised with automatic derivatives and dense QR.

#include <span>

#include "fitter/fit_residuals.h"

namespace lobe {

/// Refines the start with ceres::Solve and its default termination criteria on one thread. points: for
/// FitObjective::reflectance. The parameters are those of refineMixture. Throws std::runtime_error unless the start has
/// 1, 2, 4 or 8 components.
Mixture refineAutomatically(const FitPoints& points, std::span<const Gaussian> start);

}  // namespace lobe
