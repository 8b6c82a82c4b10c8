#pragma once
// Ray tracing with Embree. Rays hit both sides of every surface. A ray whose origin or direction is not finite, or
// beyond the range of Embree, hits nothing.

#include <memory>
#include <optional>

#include <Eigen/Geometry>

#include "runtime/render/geometry/ray.h"
#include "runtime/render/geometry/surface_hit.h"
#include "scenes/scene.h"

namespace lobe {

class RayTracer {
 public:
  /// Builds the acceleration structures with all threads that oneTBB may use. The scene must outlive the tracer. Throws
  /// std::runtime_error with Embree's message.
  explicit RayTracer(const Scene& scene);

  /// The nearest hit at a distance in (0, tfar].
  std::optional<Hit> intersect(const Ray& ray) const;

  /// Like intersect, but returns the full surface interaction.
  std::optional<SurfaceHit> trace(const Ray& ray) const;

  /// Whether there is a hit in (0, tfar); distances are in units of the direction's length.
  bool occluded(const Ray& ray) const;

  /// The time in seconds in which Embree built its acceleration structures.
  double buildSeconds() const;

  /// The bounding box of all shapes; empty without shapes.
  const Eigen::AlignedBox3f& bounds() const;

 private:
  struct Embree;
  const Scene& scene_;
  std::shared_ptr<const Embree> embree_;
};

}  // namespace lobe
