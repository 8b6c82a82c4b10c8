#pragma once
// Where a ray met a surface, with all that scattering there needs; and how rays leave it again.

#include <cstdint>
#include <optional>

#include "runtime/core/frame.h"
#include "runtime/render/geometry/ray.h"
#include "scenes/scene.h"

namespace lobe {

/// What the ray tracer answers.
struct Hit {
  float t;
  std::uint32_t shape;      ///< index into Scene::shapes
  std::uint32_t member;     ///< index into the group's shapes where the shape is an instance, else 0
  std::uint32_t primitive;  ///< triangle of a mesh, else 0
  float u, v;               ///< barycentric weights of the second and third vertex; unused for other shapes
};

/// A point on a shape, without regard to who looks at it.
struct SurfacePoint {
  Vec3 position;
  Vec3 normal;  ///< unit, on the front side (winding; outside of a sphere or cylinder unless flipped)
  Vec2 uv;
  float offset;  ///< world units by which rays that start here are moved along the normal
};

struct SurfaceHit : SurfacePoint {
  Frame frame;                 ///< shading frame after bump mapping; frame.n · normal ≥ 0
  Vec3 unmapped;               ///< unit, local in frame: the shading normal before bump mapping
  float terminatorRoughness2;  ///< of the shadowing that bump mapping asks for; 0: none
  Vec3 wo;                     ///< unit, local in frame: where the ray came from
  Vec3 woWorld;                ///< the same in world space
  float distance;              ///< of the hit along its ray
  int shape;                   ///< index into Scene::shapes
  int material;                ///< index into Scene::materials; −1 without bsdf
  const Bsdf* bsdf;            ///< nullptr: the surface absorbs everything
  const AreaEmitter* emitter;  ///< nullptr: none
};

/// The point of barycentric weights (1−b1−b2, b1, b2) on a triangle.
SurfacePoint pointOnTriangle(const TriangleMesh& mesh, std::uint32_t triangle, float b1, float b2);
/// The point of the sphere in the unit direction `outward` from its centre. uv as Mitsuba's: azimuth about the sphere's
/// own z axis over 2π, then the angle from that axis over π.
SurfacePoint pointOnSphere(const Sphere& sphere, const Vec3& outward);
/// The point centre + x·u + y·v.
SurfacePoint pointOnDisk(const Disk& disk, float x, float y);
/// The point at an azimuth from u towards v, at a height in units of the axis.
SurfacePoint pointOnCylinder(const Cylinder& cylinder, float azimuth, float height);

/// Fills in all of a SurfaceHit from what the ray tracer says. The ray's direction is unit.
SurfaceHit makeSurfaceHit(const Scene& scene, const Ray& ray, const Hit& hit);

/// The BSDF at the hit, as it is to be used in estimates: with the shadowing that bump mapping asks for, which is a
/// factor on light along wi (local in hit.frame). The hit has a bsdf.
Rgb evalBsdf(const SurfaceHit& hit, const Vec3& wi);
std::optional<BsdfSample> sampleBsdf(const SurfaceHit& hit, float choice, const Vec2& u);
std::optional<DeltaSample> sampleDelta(const SurfaceHit& hit, float choice);

/// The radiance that leaves the point towards where the ray came from by emission: front side only, else black.
Rgb emittedRadiance(const SurfaceHit& hit);

/// The point moved off its surface to the side of `direction`, by more than the error of its position and of an
/// intersection with its own surface, both proportional to the size of the coordinates (Waechter and Binder 2019,
/// "A Fast and Robust Method for Avoiding Self-Intersection"), at any scale of the scene.
inline Vec3 offsetPoint(const SurfacePoint& point, const Vec3& direction) {
  return point.position + point.normal * std::copysign(point.offset, point.normal.dot(direction));
}

inline Ray spawnRay(const SurfacePoint& point, const Vec3& direction) {
  return {offsetPoint(point, direction), direction};
}

/// Whether a direction, given in world space and in the shading frame, is on the same side of the surface for the
/// geometric and for the shading normal. Where it is not, scattering is zero, for wo and wi, in all estimators alike:
/// else light leaks through surfaces whose normals are interpolated (Mitsuba's strictNormals).
inline bool sidesAgree(const SurfaceHit& hit, const Vec3& world, const Vec3& local) {
  return hit.normal.dot(world) * local.z() > 0.0f;
}

}  // namespace lobe
