#pragma once
// From the entry of a direction grid to the direction asked for: the look-up that renderer and fitter share.

#include <span>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/grid.h"

namespace lobe {

/// Brings the mixture that was fitted for grid.direction(entry) to wo (unit, z ≥ 0). Elevations are turned to wo's
/// azimuth first. Then all means move by −(y(wo) − y(entry)), because the centre of a reflection lobe is near −y(wo);
/// the step is shortened so that no mean that lies in the disc leaves it. Writes to the front of out, which has room
/// for all components, and returns what was written. No allocation. (Herholz et al. 2016, Section 4; the sign is tested
/// by NEV.)
std::span<Gaussian> alignMixture(const DirectionGrid& grid, int entry, std::span<const Gaussian> components,
                                 const Vec3& wo, std::span<Gaussian> out);

}  // namespace lobe
