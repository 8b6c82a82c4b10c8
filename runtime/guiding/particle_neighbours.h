#pragma once
// Finds the particles around a point and tells what they say of the light there.

#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "runtime/guiding/particle.h"
#include "runtime/mixture/em.h"

namespace lobe {

/// What the particles around a point say.
struct Neighbourhood {
  /// Disc points in the frame (tangent, normal × tangent, normal). Their weights sum to the effective sample size
  /// (Σw)²/Σw² of the particles of each source, so that sources of any scale and noise can be learnt from together.
  std::vector<WeightedPoint> points;
  /// Distance of the farthest particle, of the source with the larger effective sample size.
  float radius = 0;
  /// Harmonic mean of the distances that the light came from; +infinity when all comes from the environment.
  float distance = std::numeric_limits<float>::infinity();
  /// Flux per area, from the density of particles; 0 when no source tells.
  float irradiance = 0;
};

class ParticleNeighbours {
 public:
  /// Sources: photons, samples of camera paths; viewed, they outlive it. count: of neighbours asked of each source, at
  /// most; maxDistance: world units, > 0.
  ParticleNeighbours(std::span<const std::span<const Particle>> sources, int count, float maxDistance);
  ~ParticleNeighbours();

  /// No source has a particle.
  bool empty() const { return trees_.empty(); }

  /// The nearest particles of those that arrived on the side of n at a surface turned less than 45° from it. n,
  /// tangent: unit, orthogonal.
  Neighbourhood around(const Vec3& x, const Vec3& n, const Vec3& tangent) const;

 private:
  class Tree;
  std::vector<std::unique_ptr<Tree>> trees_;
};

}  // namespace lobe
