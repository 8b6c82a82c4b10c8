#pragma once
// Conversions from vectors and colours to the types of the guiding library's public headers.

#include "lobe/types.h"
#include "runtime/core/vec.h"

namespace lobe {

inline Float3 asFloats(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}
inline Float3 asFloats(const Rgb& c) {
  return {c.x(), c.y(), c.z()};
}

}  // namespace lobe
