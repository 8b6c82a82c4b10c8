#pragma once
// A scene made ready to be rendered.

#include "runtime/render/geometry/raytracer.h"
#include "runtime/render/lights/lights.h"

namespace lobe {

struct RenderScene {
  /// The scene outlives it.
  explicit RenderScene(const Scene& s) : scene(s), tracer(s), lights(s, tracer.bounds()) {}

  /// Whether the light of a sample taken for `from.position` arrives there.
  bool visible(const SurfacePoint& from, const LightSample& light) const;

  const Scene& scene;
  RayTracer tracer;
  Lights lights;
};

inline bool RenderScene::visible(const SurfacePoint& from, const LightSample& light) const {
  if (!light.source) return !tracer.occluded(spawnRay(from, light.wi));
  // Both ends are moved off their surfaces, and the segment is cut a little short of the light besides.
  const Vec3 origin = offsetPoint(from, light.wi);
  const Vec3 target = offsetPoint(*light.source, -light.wi);
  return !tracer.occluded({origin, target - origin, 1.0f - 0x1p-18f});
}

}  // namespace lobe
