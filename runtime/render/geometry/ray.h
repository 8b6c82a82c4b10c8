#pragma once

#include <limits>

#include "runtime/core/vec.h"

namespace lobe {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// A ray from its origin up to the distance tfar. There is no near bound: origins on a surface must be offset
/// beforehand (offsetPoint and spawnRay in surface_hit.h).
struct Ray {
  Vec3 origin;
  Vec3 direction;  ///< unit length, except for the segments of occlusion tests
  float tfar = kInfinity;
};

}  // namespace lobe
