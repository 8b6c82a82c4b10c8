#pragma once
// Adaptive fitting of a lobe: the fewest records, the fewest Gaussians per record and the cheapest method that meet a
// quality target.

#include <functional>

#include "fitter/fitted_grid.h"
#include "runtime/mixture/grid.h"

namespace lobe {

/// Default quality target, a relative variance (NEV); chosen from measurements of quality against time and size.
inline constexpr float kDefaultQuality = 0.03f;

/// Fits the lobe so that the relative variance (Quality::largerVariance) of every record is at most a target where
/// settings.components Gaussians can reach it, and close to the lowest that they can reach elsewhere. The target is
/// settings.quality. For isotropic lobes it is lowered to the relative variance of weighted EM with
/// settings.components Gaussians, times max(1, quality / kDefaultQuality), if that is less. With the default quality,
/// the records of isotropic lobes are therefore as good as those of weighted EM.
///
/// Directions are visited from coarse to fine. A direction gets no record of its own if the mixture of the nearest
/// record, aligned with it by alignMixture, has a second moment of at most 1 + target times that of the record. For
/// lobes with mirrorSymmetric() only one quarter of the directions is visited. A lobe too narrow for mixtures to help
/// gets records without Gaussians. advance is called once per visited direction, from any thread; the result does not
/// depend on the number of threads. Throws std::runtime_error like fitLobe.
FittedGrid fitAdaptively(const Lobe& lobe, const DirectionGrid& grid, const FitSettings& settings,
                         const std::function<void()>& advance = {});

/// Fits one record with the fewest Gaussians, up to settings.components, that meet the target. Where the target cannot
/// be met, more Gaussians are used only if they improve the fit enough. Least squares is used only where weighted EM
/// does not meet the target.
FittedRecord fitWithFewest(const Lobe& lobe, const Vec3& wo, const FitSettings& settings);

/// The number of directions that fitAdaptively visits.
int adaptiveDirections(const Lobe& lobe, const DirectionGrid& grid);

}  // namespace lobe
