#pragma once
// The surface interaction at a ray's hit point, with all data for scattering, and rays that leave a surface.

#include <cstdint>
#include <optional>

#include "runtime/core/frame.h"
#include "runtime/render/geometry/ray.h"
#include "scenes/scene.h"

namespace lobe {

/// An intersection as the ray tracer reports it.
struct Hit {
  float t;
  std::uint32_t shape;      ///< index into Scene::shapes
  std::uint32_t member;     ///< index into the group's shapes where the shape is an instance, else 0
  std::uint32_t primitive;  ///< triangle of a mesh, else 0
  float u, v;               ///< barycentric weights of the second and third vertex; unused for other shapes
};

/// A point on a shape, independent of the viewing direction.
struct SurfacePoint {
  Vec3 position;
  Vec3 normal;  ///< unit, on the front side (winding; outside of a sphere or cylinder unless flipped)
  Vec2 uv;
  float offset;  ///< world-space length by which origins of rays are moved along the normal
};

struct SurfaceHit : SurfacePoint {
  Frame frame;                 ///< shading frame after bump mapping; frame.n · normal ≥ 0
  Vec3 unmapped;               ///< unit, local in frame: the shading normal before bump mapping
  float terminatorRoughness2;  ///< of the shadowing term for bump mapping; 0: none
  Vec3 wo;                     ///< unit, local in frame: direction from which the ray came
  Vec3 woWorld;                ///< the same in world space
  float distance;              ///< of the hit along its ray
  int shape;                   ///< index into Scene::shapes
  int material;                ///< index into Scene::materials; −1 without bsdf
  const Bsdf* bsdf;            ///< nullptr: the surface absorbs everything
  const AreaEmitter* emitter;  ///< nullptr: not an emitter
  Hit intersection;            ///< from which it was made
};

/// The point with barycentric weights (1−b1−b2, b1, b2) on a triangle.
SurfacePoint pointOnTriangle(const TriangleMesh& mesh, std::uint32_t triangle, float b1, float b2);
/// The point of the sphere in the unit direction `outward` from its centre. uv as Mitsuba's: azimuth about the sphere's
/// own z axis over 2π, then the angle from that axis over π.
SurfacePoint pointOnSphere(const Sphere& sphere, const Vec3& outward);
/// The point centre + x·u + y·v.
SurfacePoint pointOnDisk(const Disk& disk, float x, float y);
/// The point at an azimuth from u towards v, at a height in units of the axis.
SurfacePoint pointOnCylinder(const Cylinder& cylinder, float azimuth, float height);

/// The surface interaction of an intersection. The direction of the ray must be unit.
SurfaceHit makeSurfaceHit(const Scene& scene, const Ray& ray, const Hit& hit);

/// The same surface point seen from another direction (unit, world space, away from the surface). The shading frame may
/// differ, because the mapped normal may depend on the direction. The distance is kept.
SurfaceHit asSeenFrom(const Scene& scene, const SurfaceHit& hit, const Vec3& direction);

/// Whether two views of a surface point have the same shading frame, so that a delta component takes the same way in
/// both directions.
inline bool sameFrame(const SurfaceHit& a, const SurfaceHit& b) {
  return a.frame.n.dot(b.frame.n) > 1.0f - 1e-5f;
}

/// The BSDF at the hit, with the shadowing term for bump mapping, a factor that depends on wi (local in hit.frame).
/// Estimators must use these functions instead of those of hit.bsdf. hit.bsdf must not be null.
Rgb evalBsdf(const SurfaceHit& hit, const Vec3& wi);
std::optional<BsdfSample> sampleBsdf(const SurfaceHit& hit, float choice, const Vec2& u);
std::optional<DeltaSample> sampleDelta(const SurfaceHit& hit, float choice);
std::optional<DeltaTransmission> deltaTransmission(const SurfaceHit& hit);

/// The BSDF on a path from a light, which comes from hit.wo and leaves towards seen.wo, where seen is asSeenFrom that
/// direction: f(seen.wo, ω) |ω·Ns| / |ω·Ng| with the world-space direction ω of hit.wo and the shading and geometric
/// normals. Without the factor, paths from lights and from the camera would not agree (Veach 1997, Section 5.3.2).
/// Zero if a direction is on different sides of the two normals.
Rgb evalAdjointBsdf(const SurfaceHit& hit, const SurfaceHit& seen);
/// Like sampleDelta for such light: the weight is that of flux, with the same correction.
std::optional<DeltaSample> sampleAdjointDelta(const SurfaceHit& hit, float choice);

/// The radiance that the point emits towards the origin of the ray; black on the back side.
Rgb emittedRadiance(const SurfaceHit& hit);

/// The point moved off its surface to the side of `direction`, by more than the errors of its position and of an
/// intersection with its own surface. Both are proportional to the size of the coordinates, so the offset works at any
/// scale of the scene (Waechter and Binder 2019, "A Fast and Robust Method for Avoiding Self-Intersection").
inline Vec3 offsetPoint(const SurfacePoint& point, const Vec3& direction) {
  return point.position + point.normal * std::copysign(point.offset, point.normal.dot(direction));
}

inline Ray spawnRay(const SurfacePoint& point, const Vec3& direction) {
  return {offsetPoint(point, direction), direction};
}

/// Whether a direction, given in world space and in the shading frame, is on the same side of the surface for the
/// geometric and the shading normal. Otherwise scattering is zero, for wo and wi and in all estimators; this prevents
/// light leaks through surfaces with interpolated normals (Mitsuba's strictNormals).
inline bool sidesAgree(const SurfaceHit& hit, const Vec3& world, const Vec3& local) {
  return hit.normal.dot(world) * local.z() > 0.0f;
}

}  // namespace lobe
