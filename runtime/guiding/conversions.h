#pragma once
// Conversions between the public vector types and Eigen's.

#include <cmath>

#include <Eigen/Core>

#include "lobe/types.h"
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

inline bool isFinite(const Float3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace lobe
