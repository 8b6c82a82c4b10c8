#pragma once
// A scene with its ray tracer and lights.

#include "runtime/render/geometry/raytracer.h"
#include "runtime/render/lights/lights.h"

namespace lobe {

struct RenderScene {
  /// The scene must outlive it.
  explicit RenderScene(const Scene& s) : scene(s), tracer(s), lights(s, tracer.bounds()) {}

  /// Whether a light sample taken at `from.position` is unoccluded.
  bool visible(const SurfacePoint& from, const LightSample& light) const;

  const Scene& scene;
  RayTracer tracer;
  Lights lights;
};

inline bool RenderScene::visible(const SurfacePoint& from, const LightSample& light) const {
  if (!light.source) return !tracer.occluded(spawnRay(from, light.wi));
  // Both end points are moved off their surfaces, and the segment ends slightly before the light.
  const Vec3 origin = offsetPoint(from, light.wi);
  const Vec3 target = offsetPoint(*light.source, -light.wi);
  return !tracer.occluded({origin, target - origin, 1.0f - 0x1p-18f});
}

}  // namespace lobe
