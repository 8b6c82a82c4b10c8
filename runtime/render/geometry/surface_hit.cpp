#include "runtime/render/geometry/surface_hit.h"

#include <stdexcept>

#include "materials/adapters/normal_mapping.h"
#include "runtime/core/sampling.h"
#include "runtime/render/geometry/shape_geometry.h"

namespace lobe {
namespace {

// Relative to the largest coordinate. Intersections have errors of a few 2^-24 of it; the rest is a margin for grazing
// rays.
constexpr float kOffset = 0x1p-18f;
// On a coordinate plane, positions have no error along the normal, but the offset must not be zero.
constexpr float kLeastOffset = 0x1p-24f;

// extent: the largest absolute coordinates of the primitive. Only errors along the normal matter.
float offsetLength(const Vec3& normal, const Vec3& extent) {
  return kOffset * normal.cwiseAbs().dot(extent) + kLeastOffset * extent.maxCoeff();
}

struct Derivatives {
  Vec3 dpdu = Vec3::Zero();
  Vec3 dpdv = Vec3::Zero();
};

Vec3 triangleNormal(const Vec3& edge1, const Vec3& edge2) {
  // Scaled first, so that the cross product of tiny edges does not underflow.
  const float size = std::max(edge1.cwiseAbs().maxCoeff(), edge2.cwiseAbs().maxCoeff());
  return (edge1 / size).cross(edge2 / size).normalized();
}

Derivatives triangleDerivatives(const TriangleMesh& mesh, std::uint32_t triangle) {
  if (mesh.uvs.empty()) return {};
  const auto& [i, j, k] = mesh.triangles[triangle];
  const Vec2 d1 = mesh.uvs[j] - mesh.uvs[i];
  const Vec2 d2 = mesh.uvs[k] - mesh.uvs[i];
  const float determinant = d1.x() * d2.y() - d1.y() * d2.x();
  if (determinant == 0.0f) return {};
  const Vec3 edge1 = mesh.positions[j] - mesh.positions[i];
  const Vec3 edge2 = mesh.positions[k] - mesh.positions[i];
  const float inverse = 1.0f / determinant;
  const Derivatives d{(edge1 * d2.y() - edge2 * d1.y()) * inverse, (edge2 * d1.x() - edge1 * d2.x()) * inverse};
  return d.dpdu.allFinite() && d.dpdv.allFinite() ? d : Derivatives{};
}

Derivatives sphereDerivatives(const Sphere& sphere, const Vec3& position) {
  const Vec3 p = sphere.axes.transpose() * (position - sphere.centre);
  const float radial = p.head<2>().norm();
  if (radial == 0.0f) return {};
  const Vec3 dpdv(p.x() * p.z() / radial, p.y() * p.z() / radial, -radial);
  return {2.0f * kPi * sphere.axes * Vec3(-p.y(), p.x(), 0.0f), kPi * sphere.axes * dpdv};
}

Derivatives diskDerivatives(const Disk& disk, float x, float y) {
  const float radius = std::sqrt(x * x + y * y);
  if (radius == 0.0f) return {disk.u, disk.v};
  return {(x * disk.u + y * disk.v) / radius, 2.0f * kPi * (x * disk.v - y * disk.u)};
}

Derivatives cylinderDerivatives(const Cylinder& cylinder, float azimuth) {
  return {2.0f * kPi * (std::cos(azimuth) * cylinder.v - std::sin(azimuth) * cylinder.u), cylinder.axis};
}

float toUnitAzimuth(float azimuth) {
  const float turns = azimuth * (0.5f * kInvPi);
  return turns < 0.0f ? turns + 1.0f : turns;
}

Vec3 interpolatedNormal(const TriangleMesh& mesh, const Hit& hit, const Vec3& geometric) {
  if (mesh.normals.empty()) return geometric;
  const auto& [i, j, k] = mesh.triangles[hit.primitive];
  const Vec3 n = (1.0f - hit.u - hit.v) * mesh.normals[i] + hit.u * mesh.normals[j] + hit.v * mesh.normals[k];
  const float length = n.norm();
  return length > 0.0f && std::isfinite(length) ? Vec3(n / length) : geometric;
}

struct Resolved {
  SurfacePoint point;
  Vec3 shadingNormal;
  Derivatives derivatives;
};

Resolved resolve(const TriangleMesh& mesh, const Ray&, const Hit& hit) {
  const SurfacePoint point = pointOnTriangle(mesh, hit.primitive, hit.u, hit.v);
  return {point, interpolatedNormal(mesh, hit, point.normal), triangleDerivatives(mesh, hit.primitive)};
}

Resolved resolve(const Sphere& sphere, const Ray& ray, const Hit& hit) {
  const Vec3 outward = (ray.origin + hit.t * ray.direction - sphere.centre).normalized();
  const SurfacePoint point = pointOnSphere(sphere, outward);
  return {point, point.normal, sphereDerivatives(sphere, point.position)};
}

Resolved resolve(const Disk& disk, const Ray& ray, const Hit& hit) {
  const Eigen::Vector3d position =
      ray.origin.cast<double>() + (static_cast<double>(hit.t) * ray.direction.cast<double>());
  const Vec2 p = diskCoordinates(disk, position).cast<float>();
  const SurfacePoint point = pointOnDisk(disk, p.x(), p.y());
  return {point, point.normal, diskDerivatives(disk, p.x(), p.y())};
}

Resolved resolve(const Cylinder& cylinder, const Ray& ray, const Hit& hit) {
  const Vec3 p = ray.origin + hit.t * ray.direction - cylinder.base;
  const float azimuth = std::atan2(p.dot(cylinder.v), p.dot(cylinder.u));
  const SurfacePoint point = pointOnCylinder(cylinder, azimuth, p.dot(cylinder.axis) / cylinder.axis.squaredNorm());
  return {point, point.normal, cylinderDerivatives(cylinder, azimuth)};
}

/// Transforms from the space of a group to world space. The offset covers the errors of both spaces.
Resolved transformed(const Resolved& r, const Eigen::Affine3f& toWorld) {
  const Eigen::Matrix3f linear = toWorld.linear();
  const Eigen::Matrix3f forNormals = linear.inverse().transpose();
  Resolved result = r;
  result.point.position = toWorld * r.point.position;
  result.point.normal = (forNormals * r.point.normal).normalized();
  const Vec3 extent = linear.cwiseAbs() * r.point.position.cwiseAbs() + toWorld.translation().cwiseAbs();
  result.point.offset = r.point.offset * linear.norm() + offsetLength(result.point.normal, extent);
  result.shadingNormal = (forNormals * r.shadingNormal).normalized();
  result.derivatives = {linear * r.derivatives.dpdu, linear * r.derivatives.dpdv};
  return result;
}

Resolved resolve(const Shape& shape, const Ray& ray, const Hit& hit) {
  return std::visit(
      [&](const auto& geometry) -> Resolved {
        if constexpr (std::is_same_v<std::decay_t<decltype(geometry)>, Instance>)
          throw std::logic_error("nested instances are not supported");
        else
          return resolve(geometry, ray, hit);
      },
      shape.geometry);
}

/// Distances along a ray are the same in both spaces, because the transformed direction is not normalised.
Resolved resolveInstanced(const Instance& instance, const Shape& shape, const Ray& ray, const Hit& hit) {
  const Eigen::Affine3f toGroup = instance.toWorld.inverse();
  const Ray inGroup{toGroup * ray.origin, toGroup.linear() * ray.direction};
  return transformed(resolve(shape, inGroup, hit), instance.toWorld);
}

Vec3 facing(const Vec3& normal, const Vec3& side) {
  return normal.dot(side) < 0.0f ? Vec3(-normal) : normal;
}

/// Sets the shading frame and the values that follow from bump mapping; hit.bsdf and hit.woWorld must be set. unit: the
/// unit of lengths in BSDFs, such as the height of bumps, in scene units.
/// Whether the point leaves all light as it is: null, or a mask where it is transparent.
bool isInvisible(const Bsdf& bsdf, const Vec2& uv) {
  if (!bsdf.transmits()) return false;
  const std::optional<DeltaTransmission> through = bsdf.deltaTransmission(Vec3::UnitZ(), uv);
  return through && through->straight && (through->weight >= 1.0f).all();
}

/// Invisible points have the geometric frame, which lets light pass from every direction.
void setFrame(const Resolved& r, float unit, SurfaceHit& hit) {
  const bool invisible = hit.bsdf && isInvisible(*hit.bsdf, r.point.uv);
  const Vec3 normal = invisible ? r.point.normal : facing(r.shadingNormal, r.point.normal);
  const Frame frame = Frame::fromTangent(normal, r.derivatives.dpdu);
  hit.frame = frame;
  hit.unmapped = Vec3::UnitZ();
  hit.terminatorRoughness2 = 0.0f;
  if (!hit.bsdf || invisible) return;
  const Vec3 local =
      hit.bsdf->perturbedNormal(frame.toLocal(hit.woWorld), r.point.uv, frame.toLocal(r.derivatives.dpdu / unit),
                                frame.toLocal(r.derivatives.dpdv / unit));
  if (local == Vec3::UnitZ() || !local.allFinite()) return;
  hit.frame = Frame::fromTangent(facing(frame.toWorld(local).normalized(), r.point.normal), r.derivatives.dpdu);
  hit.unmapped = hit.frame.toLocal(frame.n);
  if (hit.bsdf->shadowsTerminator()) hit.terminatorRoughness2 = terminatorRoughness2(hit.unmapped.z());
}

/// Smith's shadowing term of GGX microfacets on the surface without bump mapping. Light that passes straight through,
/// as through a mask, is not shadowed.
float terminatorShadowing(const SurfaceHit& hit, const Vec3& wi) {
  if (hit.terminatorRoughness2 <= 0.0f || wi == -hit.wo) return 1.0f;
  const float cosine = hit.unmapped.dot(wi);
  const float cosine2 = std::min(1.0f, cosine * cosine);
  return 2.0f / (1.0f + std::sqrt(1.0f + hit.terminatorRoughness2 * (1.0f - cosine2) / cosine2));
}

}  // namespace

SurfacePoint pointOnTriangle(const TriangleMesh& mesh, std::uint32_t triangle, float b1, float b2) {
  const auto& [i, j, k] = mesh.triangles[triangle];
  const Vec3& a = mesh.positions[i];
  const Vec3& b = mesh.positions[j];
  const Vec3& c = mesh.positions[k];
  const float b0 = 1.0f - b1 - b2;
  SurfacePoint point;
  point.position = b0 * a + b1 * b + b2 * c;
  point.normal = triangleNormal(b - a, c - a);
  point.uv = mesh.uvs.empty() ? Vec2(b1, b2) : Vec2(b0 * mesh.uvs[i] + b1 * mesh.uvs[j] + b2 * mesh.uvs[k]);
  point.offset = offsetLength(point.normal, a.cwiseAbs().cwiseMax(b.cwiseAbs()).cwiseMax(c.cwiseAbs()));
  return point;
}

SurfacePoint pointOnSphere(const Sphere& sphere, const Vec3& outward) {
  SurfacePoint point;
  point.position = sphere.centre + sphere.radius * outward;
  point.normal = sphere.flipped ? Vec3(-outward) : outward;
  const Vec3 own = sphere.axes.transpose() * outward;
  point.uv = {toUnitAzimuth(std::atan2(own.y(), own.x())), std::atan2(own.head<2>().norm(), own.z()) * kInvPi};
  point.offset = offsetLength(point.normal, sphere.centre.cwiseAbs() + Vec3::Constant(sphere.radius));
  return point;
}

SurfacePoint pointOnDisk(const Disk& disk, float x, float y) {
  SurfacePoint point;
  point.position = disk.centre + x * disk.u + y * disk.v;
  point.normal = (disk.flipped ? -1.0f : 1.0f) * triangleNormal(disk.u, disk.v);
  point.uv = {std::sqrt(x * x + y * y), toUnitAzimuth(std::atan2(y, x))};
  point.offset = offsetLength(point.normal, disk.centre.cwiseAbs() + disk.u.cwiseAbs() + disk.v.cwiseAbs());
  return point;
}

SurfacePoint pointOnCylinder(const Cylinder& cylinder, float azimuth, float height) {
  SurfacePoint point;
  const Vec3 radial = std::cos(azimuth) * cylinder.u + std::sin(azimuth) * cylinder.v;
  point.position = cylinder.base + radial + height * cylinder.axis;
  point.normal = (cylinder.flipped ? -radial : radial).normalized();
  point.uv = {toUnitAzimuth(azimuth), height};
  const Vec3 extent =
      cylinder.base.cwiseAbs() + cylinder.axis.cwiseAbs() + cylinder.u.cwiseAbs() + cylinder.v.cwiseAbs();
  point.offset = offsetLength(point.normal, extent);
  return point;
}

SurfaceHit makeSurfaceHit(const Scene& scene, const Ray& ray, const Hit& hit) {
  const Shape& placed = scene.shapes[hit.shape];
  const auto* instance = std::get_if<Instance>(&placed.geometry);
  const Shape& shape = instance ? scene.groups[instance->group].shapes[hit.member] : placed;
  const Resolved r = instance ? resolveInstanced(*instance, shape, ray, hit) : resolve(shape, ray, hit);
  SurfaceHit result;
  static_cast<SurfacePoint&>(result) = r.point;
  result.bsdf = shape.material < 0 ? nullptr : scene.materials[shape.material].bsdf.get();
  result.emitter = shape.emitter ? &*shape.emitter : nullptr;
  result.woWorld = -ray.direction;
  setFrame(r, scene.scale, result);
  result.wo = result.frame.toLocal(result.woWorld);
  result.distance = hit.t;
  result.shape = static_cast<int>(hit.shape);
  result.material = shape.material;
  result.intersection = hit;
  return result;
}

SurfaceHit asSeenFrom(const Scene& scene, const SurfaceHit& hit, const Vec3& direction) {
  if (hit.bsdf && hit.bsdf->mapsNormals()) {
    Hit here = hit.intersection;
    here.t = 0.0f;
    SurfaceHit seen = makeSurfaceHit(scene, {hit.position, -direction}, here);
    seen.distance = hit.distance;
    return seen;
  }
  SurfaceHit seen = hit;
  seen.woWorld = direction;
  seen.wo = seen.frame.toLocal(direction);
  return seen;
}

Rgb evalBsdf(const SurfaceHit& hit, const Vec3& wi) {
  return hit.bsdf->eval(hit.wo, wi, hit.uv) * terminatorShadowing(hit, wi);
}

std::optional<BsdfSample> sampleBsdf(const SurfaceHit& hit, float choice, const Vec2& u) {
  std::optional<BsdfSample> sample = hit.bsdf->sample(hit.wo, hit.uv, choice, u);
  if (sample) sample->f *= terminatorShadowing(hit, sample->wi);
  return sample;
}

std::optional<DeltaSample> sampleDelta(const SurfaceHit& hit, float choice) {
  std::optional<DeltaSample> sample = hit.bsdf->sampleDelta(hit.wo, hit.uv, choice);
  if (sample) sample->weight *= terminatorShadowing(hit, sample->wi);
  return sample;
}

std::optional<DeltaTransmission> deltaTransmission(const SurfaceHit& hit) {
  std::optional<DeltaTransmission> transmission = hit.bsdf->deltaTransmission(hit.wo, hit.uv);
  if (transmission) transmission->weight *= terminatorShadowing(hit, transmission->wi);
  return transmission;
}

Rgb evalAdjointBsdf(const SurfaceHit& hit, const SurfaceHit& seen) {
  const Vec3 wi = seen.frame.toLocal(hit.woWorld);
  if (!sidesAgree(seen, seen.woWorld, seen.wo) || !sidesAgree(seen, hit.woWorld, wi)) return Rgb::Zero();
  return evalBsdf(seen, wi) * std::abs(wi.z() / hit.normal.dot(hit.woWorld));
}

std::optional<DeltaSample> sampleAdjointDelta(const SurfaceHit& hit, float choice) {
  std::optional<DeltaSample> sample = hit.bsdf->sampleDelta(hit.wo, hit.uv, choice);
  if (!sample) return std::nullopt;
  const float in = std::abs(hit.wo.z() / hit.normal.dot(hit.woWorld));
  const float out = std::abs(hit.normal.dot(hit.frame.toWorld(sample->wi)) / sample->wi.z());
  sample->weight *= sample->eta * sample->eta * in * out;
  if (sample->wi != -hit.wo) sample->weight *= terminatorShadowing(hit, hit.wo);
  return sample;
}

Rgb emittedRadiance(const SurfaceHit& hit) {
  if (!hit.emitter || hit.normal.dot(hit.woWorld) <= 0.0f) return Rgb::Zero();
  return hit.emitter->radiance->eval(hit.uv);
}

}  // namespace lobe
