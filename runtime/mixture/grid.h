#pragma once
// The grids of outgoing directions for which BRDF mixtures are fitted: elevations for isotropic lobes, spherical
// Fibonacci points for anisotropic ones. A grid depends on its kind and count only, so that fitter and renderer always
// agree.

#include <cstdint>

#include "runtime/mixture/disc.h"

namespace lobe {

enum class GridKind : std::uint8_t { elevation = 0, fibonacci = 1 };

struct DirectionGrid {
  GridKind kind = GridKind::elevation;
  int count = 0;  ///< ≥ 1

  /// The unit direction of an entry, z > 0. Elevations lie in the half-plane y = 0, x ≥ 0, and are denser towards
  /// grazing angles: θ = 90°·(t/2 + (1 − (1−t)³)/2) with t = (index + ½)/count, so that 0° and 90° are excluded.
  Vec3 direction(int index) const;

  /// The index of the entry nearest to w (unit, z ≥ 0), in constant time: for elevations nearest in elevation, for
  /// Fibonacci points nearest in angle (Keinert et al. 2015).
  int nearest(const Vec3& w) const;
};

}  // namespace lobe
