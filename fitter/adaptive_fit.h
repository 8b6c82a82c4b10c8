#pragma once
// The fit that chooses for itself: as few records, as few components and as cheap a method as the quality asked for
// allows.

#include <functional>

#include "fitter/fitted_grid.h"
#include "runtime/mixture/grid.h"

namespace lobe {

/// The quality that charts of quality against time and size recommend.
inline constexpr float kDefaultQuality = 0.03f;

/// Fits the lobe so that every record has an NEV (Quality::worse) of at most a target, where settings.components
/// Gaussians can do that, and near the best that they can elsewhere. The target is settings.quality or, of an isotropic
/// lobe and if less, what as many Gaussians have by weighted EM, times quality / kDefaultQuality where more than the
/// default is allowed: so by default the records of isotropic lobes are as good as weighted EM's.
///
/// Directions are taken from coarse to fine. One that the record nearest to it serves with a second moment at most
/// 1 + target times the record's own, brought to it by alignMixture, gets none of its own. Of a lobe with
/// mirrorSymmetric, a quarter of the directions is looked at. A lobe so narrow that no mixture could help gets records
/// without components. advance is called for every direction looked at, from any thread; the result does not depend on
/// the number of threads. Throws std::runtime_error as fitLobe.
FittedGrid fitAdaptively(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                         const std::function<void()>& advance = {});

/// One record, by the fewest of at most settings.components Gaussians that meet the target, or by more of them only as
/// far as they are worth it; by weighted EM where that is enough.
FittedRecord fitWithFewest(const Lobe& lobe, const Vec3& wo, const FitSettings& settings);

/// How many directions fitAdaptively looks at.
int adaptiveDirections(const Lobe& lobe, const DirectionGrid& grid);

}  // namespace lobe
