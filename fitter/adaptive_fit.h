#pragma once
// The fit that chooses for itself: as few records, as few components and as cheap a method as the quality asked for
// allows.

#include <functional>

#include "fitter/fitted_grid.h"
#include "runtime/mixture/grid.h"

namespace lobe {

/// Fits the lobe so that every record has an NEV (the worse of both estimates of Quality) of settings.quality, where
/// settings.components Gaussians can do that, and near the best that they can elsewhere.
///
/// Directions are taken from coarse to fine. One that the record nearest to it serves with a second moment at most
/// 1 + settings.quality times the record's own, brought to it by alignMixture, gets none of its own. Of a lobe with
/// mirrorSymmetric, a quarter of the directions is looked at. A lobe so narrow that no mixture could help gets records
/// without components. advance is called for every direction looked at, from any thread; the result does not depend on
/// the number of threads. Throws std::runtime_error as fitLobe.
FittedGrid fitAdaptively(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                         const std::function<void()>& advance = {});

/// One record, by the fewest of at most settings.components Gaussians that have settings.quality, or by more of them
/// only as far as they are worth it; by weighted EM where that is enough.
FittedRecord fitWithFewest(const Lobe& lobe, const Vec3& wo, const FitSettings& settings);

/// How many directions fitAdaptively looks at.
int adaptiveDirections(const Lobe& lobe, const DirectionGrid& grid);

}  // namespace lobe
