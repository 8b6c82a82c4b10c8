#pragma once
// The grids of directions that BRDF mixtures are fitted for: elevations for isotropic lobes, spherical Fibonacci points
// for anisotropic ones. A pure function of kind, count and index, so that fitter and renderer agree by construction.

#include <cstdint>

#include "runtime/mixture/disc.h"

namespace lobe {

enum class GridKind : std::uint8_t { elevation = 0, fibonacci = 1 };

struct DirectionGrid {
  GridKind kind = GridKind::elevation;
  int count = 0;  ///< ≥ 1

  /// The unit direction of an entry, z > 0. Elevations lie in the plane y = 0, x ≥ 0, and are denser towards grazing:
  /// θ = 90°·(t/2 + (1 − (1−t)³)/2) with t = (index + ½)/count, so that neither end is hit exactly.
  Vec3 direction(int index) const;

  /// The entry nearest to w (z ≥ 0, unit). Elevations: nearest in elevation, by inverting the spacing. Fibonacci:
  /// nearest in angle among the upper-hemisphere points, in constant time (Keinert et al. 2015).
  int nearest(const Vec3& w) const;
};

}  // namespace lobe
