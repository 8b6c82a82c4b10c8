#pragma once
// Outgoing directions of the records of a BRDF cache.

#include <cmath>
#include <numbers>

#include "runtime/mixture/grid.h"
#include "schema/lobe_cache.h"

namespace lobe {

inline DirectionGrid gridOf(const LobeCache& cache) {
  return {static_cast<GridKind>(cache.info().gridKind), static_cast<int>(cache.info().gridCount)};
}

inline const char* gridName(const DirectionGrid& grid) {
  return grid.kind == GridKind::elevation ? "elevation" : "fibonacci";
}

/// The direction for which a record was fitted.
inline Vec3 directionOf(const LobeCache& cache, std::size_t record) {
  return gridOf(cache).direction(static_cast<int>(cache.records()[record].entry));
}

/// In degrees; the elevation is measured from the normal.
struct Angles {
  double elevation, azimuth;
};

inline Angles anglesOf(const Vec3& w) {
  const double degrees = 180 * std::numbers::inv_pi;
  return {std::atan2(std::hypot(w.x(), w.y()), w.z()) * degrees, std::atan2(w.y(), w.x()) * degrees};
}

}  // namespace lobe
