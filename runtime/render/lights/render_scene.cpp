#include "runtime/render/lights/render_scene.h"

#include <algorithm>

namespace lobe {
namespace {

bool anyTransmits(const Scene& scene) {
  return std::ranges::any_of(scene.materials, [](const Material& m) { return m.bsdf && m.bsdf->transmits(); });
}

/// Whether the surface is the same for light that arrives from the direction in which the ray leaves it.
bool reversible(const Scene& scene, const SurfaceHit& hit, const Vec3& direction) {
  return !hit.bsdf->mapsNormals() || sameFrame(hit, asSeenFrom(scene, hit, direction));
}

/// Segments end slightly before the light, so that they do not hit it.
constexpr float kBeforeLight = 1.0f - 0x1p-18f;

}  // namespace

RenderScene::RenderScene(const Scene& s, int surfaces)
    : scene(s), tracer(s), lights(s, tracer.bounds()), shadowSurfaces(anyTransmits(s) ? surfaces : 0) {}

bool RenderScene::visible(const SurfacePoint& from, const LightSample& light) const {
  return light.source ? visible(from, *light.source) : !tracer.occluded(spawnRay(from, light.wi));
}

bool RenderScene::visible(const SurfacePoint& from, const SurfacePoint& to) const {
  // Both end points are moved off their surfaces.
  const Vec3 direction = to.position - from.position;
  const Vec3 origin = offsetPoint(from, direction);
  const Vec3 target = offsetPoint(to, -direction);
  return !tracer.occluded({origin, target - origin, kBeforeLight});
}

std::optional<SurfaceHit> RenderScene::firstVisible(Ray ray, EmitterVisibility visibility, std::uint64_t& rays) const {
  float passed = 0;
  for (;;) {
    ++rays;
    std::optional<SurfaceHit> hit = tracer.trace(ray);
    if (!hit) return hit;
    if (!hit->emitter || visibility != EmitterVisibility::hidden) {
      hit->distance += passed;
      return hit;
    }
    passed += hit->distance;
    ray.tfar -= hit->distance;
    ray.origin = offsetPoint(*hit, ray.direction);
  }
}

std::optional<SurfaceHit> RenderScene::firstVisible(const Ray& ray) const {
  std::uint64_t rays = 0;
  return firstVisible(ray, scene.emitterVisibility, rays);
}

bool RenderScene::visibleToCamera(const SurfaceHit& point, const Ray& ray, EmitterVisibility visibility) const {
  const Vec3 origin = offsetPoint(point, -ray.direction);
  if (visibility != EmitterVisibility::hidden) return !tracer.occluded({origin, ray.origin - origin, 1.0f});
  if (point.emitter) return false;
  std::uint64_t rays = 0;
  const Vec3 segment = ray.origin - origin;
  const float length = segment.norm();
  return !firstVisible({origin, segment / length, length}, visibility, rays);
}

TransmittedRay RenderScene::follow(Ray ray, int maxSurfaces, const Vec3* target) const {
  TransmittedRay result;
  for (;;) {
    result.last = ray;
    result.hit = tracer.trace(ray);
    if (!result.hit || result.surfaces == maxSurfaces) return result;
    const SurfaceHit& hit = *result.hit;
    if (!hit.bsdf || !hit.bsdf->transmits() || !sidesAgree(hit, hit.woWorld, hit.wo)) return result;
    const std::optional<DeltaTransmission> through = deltaTransmission(hit);
    if (!through || (target && !through->straight)) return result;
    const Vec3 direction = hit.frame.toWorld(through->wi).normalized();
    if (!sidesAgree(hit, direction, through->wi) || !(through->weight.maxCoeff() > 0)) return result;
    result.transmittance *= through->weight;
    result.bent = result.bent || !through->straight;
    result.eta *= through->eta;
    result.reversible = result.reversible && reversible(scene, hit, direction);
    ++result.surfaces;
    ray = spawnRay(hit, direction);
    if (target) {
      const Vec3 left = *target - ray.origin;
      ray.tfar = left.norm() * kBeforeLight;
      ray.direction = left.normalized();
    }
  }
}

ArrivingLight RenderScene::arriving(const SurfacePoint& from, const LightSample& light, int maxSurfaces) const {
  ArrivingLight result;
  result.last = spawnRay(from, light.wi);
  const int most = std::min(shadowSurfaces, maxSurfaces);
  if (most <= 0) {
    if (visible(from, light)) result.radiance = light.radiance;
    return result;
  }
  TransmittedRay end;
  if (light.source) {
    const Vec3 target = offsetPoint(*light.source, -light.wi);
    const Vec3 segment = target - result.last.origin;
    const float length = segment.norm();
    if (!(length > 0)) return result;
    end = follow({result.last.origin, segment / length, length * kBeforeLight}, most, &target);
  } else {
    end = follow(result.last, most);
  }
  result.rays += end.surfaces;
  result.last = end.last;
  result.eta = end.eta;
  result.reversible = end.reversible;
  // A directional light is not found along a direction that was changed.
  if (!end.hit && !(end.bent && light.delta))
    result.radiance = end.transmittance * (end.bent ? lights.environmentRadiance(end.last.direction) : light.radiance);
  return result;
}

std::optional<DeltaTransmission> sharedTransmission(const SurfaceHit& hit, const Vec3& wi) {
  return wi.z() * hit.wo.z() < 0 ? deltaTransmission(hit) : std::nullopt;
}

void LightPassage::pass(const SurfaceHit& hit, const Vec3& wi, int shadowSurfaces) {
  if (!specular || !followed) return;
  const std::optional<DeltaTransmission> through = sharedTransmission(hit, wi);
  followed = through && ++surfaces <= shadowSurfaces;
  bent = bent || !through || !through->straight;
  distance += hit.distance;
}

void EmissionWeight::passed(const SurfaceHit& hit, const Vec3& wi, int shadowSurfaces) {
  if (pdf_ <= 0) return;
  const std::optional<DeltaTransmission> through = sharedTransmission(hit, wi);
  if (!through || ++surfaces_ > shadowSurfaces)
    pdf_ = 0;
  else
    bent_ = bent_ || !through->straight;
}

}  // namespace lobe
