#pragma once
// Finds the particles near a point and derives from them the incident light there.

#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "runtime/guiding/particle.h"
#include "runtime/mixture/em.h"

namespace lobe {

/// The particles near a point, and estimates derived from them.
struct Neighbourhood {
  /// Directions as disc points in the frame (tangent, normal × tangent, normal). The weights of each source are scaled
  /// to sum to its effective sample size (Σw)²/Σw², so that sources of different scale and noise can be combined.
  std::vector<WeightedPoint> points;
  /// Distance of the farthest particle of the source with the largest effective sample size, in world units.
  float radius = 0;
  /// Weighted harmonic mean of the distances travelled by the light; +infinity if all of it comes from the environment.
  float distance = std::numeric_limits<float>::infinity();
  /// Irradiance (flux per area) by density estimation; 0 if no particle carries flux.
  float irradiance = 0;
};

class ParticleNeighbours {
 public:
  /// sources: photons and samples of camera paths, which must outlive this object. count: largest number of neighbours
  /// per source; maxDistance: largest distance in world units, > 0.
  ParticleNeighbours(std::span<const std::span<const Particle>> sources, int count, float maxDistance);
  ~ParticleNeighbours();

  /// Whether no source has a particle.
  bool empty() const { return trees_.empty(); }

  /// Whether a particle carries flux, from which the irradiance follows: photons do, samples of camera paths do not.
  bool carryFlux() const { return carryFlux_; }

  /// The nearest particles that arrived on the side of n, at surfaces whose normal is within 45° of n. n, tangent: unit
  /// and orthogonal.
  Neighbourhood around(const Vec3& x, const Vec3& n, const Vec3& tangent) const;

 private:
  class Tree;
  std::vector<std::unique_ptr<Tree>> trees_;
  bool carryFlux_;
};

}  // namespace lobe
