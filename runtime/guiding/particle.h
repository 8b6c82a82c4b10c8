#pragma once
// What training learns from, and what it is asked for.

#include "runtime/mixture/disc.h"

namespace lobe {

/// Light that arrived at a surface. weight is flux (luminance): particles have density L cosθ per area.
struct Particle {
  Vec3 position;
  Vec3 normal;     ///< unit geometric normal, on the side the light arrived at
  Vec3 direction;  ///< unit, from the surface to where the light came from
  float weight;    ///< ≥ 0
  float distance;  ///< world units travelled since the last vertex; +infinity from the environment
  /// What of the light's flux this particle stands for, all of it, also what weight leaves to emitter sampling; 0 where
  /// the density of particles does not tell (samples of camera paths).
  float flux = 0;
};

/// A place where a path asked for a record and found none.
struct RecordRequest {
  Vec3 position;
  Vec3 normal;  ///< unit, on the side of the path
};

}  // namespace lobe
