#pragma once

#include <limits>

#include "runtime/core/vec.h"

namespace lobe {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// A half-line, or the part of it up to tfar. It starts at its origin: origins that lie on a surface are moved off it
/// beforehand (offsetPoint, spawnRay in surface_hit.h).
struct Ray {
  Vec3 origin;
  Vec3 direction;  ///< unit, unless tfar says that it is a segment (occlusion tests)
  float tfar = kInfinity;
};

}  // namespace lobe
