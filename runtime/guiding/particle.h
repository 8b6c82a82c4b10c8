#pragma once
// The input of training: particles, and requests for records.

#include "runtime/mixture/disc.h"

namespace lobe {

/// Light that arrived at a surface. The directions of the particles near a point, weighted by `weight`, are distributed
/// in proportion to L cosθ.
struct Particle {
  Vec3 position;   ///< world space
  Vec3 normal;     ///< unit geometric normal on the side where the light arrived
  Vec3 direction;  ///< unit, from the surface towards the light's origin
  float weight;    ///< luminance, ≥ 0; of photons the flux, without the part handled by next-event estimation
  /// World units travelled since the last vertex, > 0; +infinity for light from the environment. Other values count as
  /// infinite.
  float distance;
  /// Total flux (luminance), before subtracting the part handled by next-event estimation. 0 for samples of camera
  /// paths, whose density does not give the irradiance.
  float flux = 0;
};

/// A point at which a path found no record.
struct RecordRequest {
  Vec3 position;
  Vec3 normal;  ///< unit geometric normal on the side of the path
};

}  // namespace lobe
