#pragma once
// Conversions between the public vector types and Eigen's.

#include <cmath>

#include <Eigen/Core>

#include "lobe/surface_distribution.h"
#include "runtime/mixture/disc.h"

namespace lobe {

inline Vec2 toEigen(const Float2& v) {
  return {v.x, v.y};
}
inline Vec3 toEigen(const Float3& v) {
  return {v.x, v.y, v.z};
}
inline Float2 toFloats(const Vec2& v) {
  return {v.x(), v.y()};
}
inline Float3 toFloats(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

/// 1 if the path is on the side of the shading normal, else −1.
inline float sideOf(const ShadingPoint& point) {
  return point.wo.z >= 0 ? 1.0f : -1.0f;
}

inline bool isFinite(const Float3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace lobe
