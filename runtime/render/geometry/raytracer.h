#pragma once
// Ray tracing with Embree. Both sides of every surface are hit.

#include <memory>
#include <optional>

#include <Eigen/Geometry>

#include "runtime/render/geometry/ray.h"
#include "runtime/render/geometry/surface_hit.h"
#include "scenes/scene.h"

namespace lobe {

class RayTracer {
 public:
  /// Copies the geometry it needs; the scene outlives it all the same (for surface). Builds with all threads that
  /// oneTBB may use. Throws std::runtime_error with Embree's message.
  explicit RayTracer(const Scene& scene);

  /// The nearest hit in (0, tfar].
  std::optional<Hit> intersect(const Ray& ray) const;

  /// intersect, with everything about the point.
  std::optional<SurfaceHit> trace(const Ray& ray) const;

  /// Whether anything is hit in (0, tfar); distances in units of the direction's length.
  bool occluded(const Ray& ray) const;

  /// What Embree took for its acceleration structures.
  double buildSeconds() const;

  /// Of all shapes; empty without shapes.
  const Eigen::AlignedBox3f& bounds() const;

 private:
  struct Embree;
  const Scene& scene_;
  std::shared_ptr<const Embree> embree_;
};

}  // namespace lobe
