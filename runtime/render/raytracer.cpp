#include "runtime/render/raytracer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <embree3/rtcore.h>
#include <fmt/format.h>

namespace lobe {
namespace {

// Spheres and disks are solved in double precision: their errors are then those of the ray itself, at any scale.
using Vec3d = Eigen::Vector3d;

struct Interval {
  double tnear, tfar;
  bool contains(double t) const { return t > tnear && t <= tfar; }
};

std::optional<double> intersectSphere(const Sphere& sphere, const Vec3d& origin, const Vec3d& direction,
                                      const Interval& range) {
  // The discriminant from the distance between centre and line does not cancel (Haines et al. 2019).
  const double a = direction.squaredNorm();
  const Vec3d f = origin - sphere.centre.cast<double>();
  const double b = -f.dot(direction);
  const double radius2 = static_cast<double>(sphere.radius) * sphere.radius;
  const double discriminant = radius2 - (f + (b / a) * direction).squaredNorm();
  if (discriminant < 0.0) return std::nullopt;
  const double q = b + std::copysign(std::sqrt(a * discriminant), b);
  const double c = f.squaredNorm() - radius2;
  double t0 = q == 0.0 ? 0.0 : c / q;
  double t1 = q / a;
  if (t0 > t1) std::swap(t0, t1);
  if (range.contains(t0)) return t0;
  if (range.contains(t1)) return t1;
  return std::nullopt;
}

std::optional<double> intersectDisk(const Disk& disk, const Vec3d& origin, const Vec3d& direction,
                                    const Interval& range) {
  const Vec3d u = disk.u.cast<double>();
  const Vec3d v = disk.v.cast<double>();
  const Vec3d normal = u.cross(v);
  const Vec3d centre = disk.centre.cast<double>();
  const double t = (centre - origin).dot(normal) / direction.dot(normal);
  if (!range.contains(t)) return std::nullopt;  // also where the ray runs along the plane (t is no number)
  const Vec3d p = origin + t * direction - centre;
  const double x = p.dot(u) / u.squaredNorm();
  const double y = p.dot(v) / v.squaredNorm();
  if (x * x + y * y > 1.0) return std::nullopt;
  return t;
}

std::optional<double> intersectGeometry(const Geometry& geometry, const Vec3d& o, const Vec3d& d,
                                        const Interval& range) {
  if (const auto* sphere = std::get_if<Sphere>(&geometry)) return intersectSphere(*sphere, o, d, range);
  if (const auto* disk = std::get_if<Disk>(&geometry)) return intersectDisk(*disk, o, d, range);
  return std::nullopt;
}

Eigen::AlignedBox3f boundsOf(const TriangleMesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t i : triangle) box.extend(mesh.positions[i]);
  return box;
}
Eigen::AlignedBox3f boundsOf(const Sphere& sphere) {
  const Vec3 r = Vec3::Constant(sphere.radius);
  return {sphere.centre - r, sphere.centre + r};
}
Eigen::AlignedBox3f boundsOf(const Disk& disk) {
  const Vec3 r = (disk.u.array().square() + disk.v.array().square()).sqrt();
  return {disk.centre - r, disk.centre + r};
}

void reportBounds(const RTCBoundsFunctionArguments* args) {
  const Shape& shape = *static_cast<const Shape*>(args->geometryUserPtr);
  Eigen::AlignedBox3f box = std::visit([](const auto& g) { return boundsOf(g); }, shape.geometry);
  // The box was rounded; it has to contain the shape.
  const Vec3 margin = (box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs())) * 0x1p-21f;
  box = {box.min() - margin, box.max() + margin};
  *args->bounds_o = {box.min().x(), box.min().y(), box.min().z(), 0, box.max().x(), box.max().y(), box.max().z(), 0};
}

// Only single rays are traced, so a callback's one ray has the layout of RTCRay.
std::optional<double> intersectUser(const Shape& shape, const RTCRay& ray) {
  const Vec3d origin(ray.org_x, ray.org_y, ray.org_z);
  const Vec3d direction(ray.dir_x, ray.dir_y, ray.dir_z);
  return intersectGeometry(shape.geometry, origin, direction, {ray.tnear, ray.tfar});
}

void intersectCallback(const RTCIntersectFunctionNArguments* args) {
  if (!args->valid[0]) return;
  auto& [ray, hit] = *reinterpret_cast<RTCRayHit*>(args->rayhit);
  const std::optional<double> t = intersectUser(*static_cast<const Shape*>(args->geometryUserPtr), ray);
  if (!t) return;
  ray.tfar = static_cast<float>(*t);
  hit.u = hit.v = 0.0f;
  hit.primID = args->primID;
  hit.geomID = args->geomID;
  hit.instID[0] = args->context->instID[0];
}

void occludedCallback(const RTCOccludedFunctionNArguments* args) {
  if (!args->valid[0]) return;
  auto& ray = *reinterpret_cast<RTCRay*>(args->ray);
  if (intersectUser(*static_cast<const Shape*>(args->geometryUserPtr), ray)) ray.tfar = -kInfinity;
}

RTCRay embreeRay(const Ray& ray) {
  RTCRay r{};
  r.org_x = ray.origin.x();
  r.org_y = ray.origin.y();
  r.org_z = ray.origin.z();
  r.dir_x = ray.direction.x();
  r.dir_y = ray.direction.y();
  r.dir_z = ray.direction.z();
  r.tfar = ray.tfar;
  r.mask = ~0u;
  return r;
}

void fillMesh(RTCGeometry geometry, const TriangleMesh& mesh) {
  // Embree's own buffers have the padding that its loads need.
  void* positions = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3),
                                            mesh.positions.size());
  void* triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            3 * sizeof(std::uint32_t), mesh.triangles.size());
  if (!positions || !triangles) throw std::runtime_error("not enough memory for the scene's geometry");
  std::memcpy(positions, mesh.positions.data(), mesh.positions.size() * sizeof(Vec3));
  std::memcpy(triangles, mesh.triangles.data(), mesh.triangles.size() * 3 * sizeof(std::uint32_t));
}

void fillUser(RTCGeometry geometry, const Shape& shape) {
  rtcSetGeometryUserPrimitiveCount(geometry, 1);
  rtcSetGeometryUserData(geometry, const_cast<Shape*>(&shape));
  rtcSetGeometryBoundsFunction(
      geometry, [](const RTCBoundsFunctionArguments* a) { reportBounds(a); }, nullptr);
  rtcSetGeometryIntersectFunction(geometry, intersectCallback);
  rtcSetGeometryOccludedFunction(geometry, occludedCallback);
}

bool isEmptyMesh(const Shape& shape) {
  const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry);
  return mesh && mesh->triangles.empty();
}

}  // namespace

struct RayTracer::Embree {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = nullptr;

  Embree() {
    if (!device) throw std::runtime_error("Embree: no device");
    rtcSetDeviceErrorFunction(
        device,
        [](void* text, RTCError, const char* message) { *static_cast<std::string*>(text) = message ? message : "?"; },
        &error);
    scene = rtcNewScene(device);
    // Robust: rays do not slip through shared edges. High quality: built once, traced hundreds of millions of times.
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;
  ~Embree() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }

  void add(const Shape& shape, unsigned id) {
    const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry);
    RTCGeometry geometry = rtcNewGeometry(device, mesh ? RTC_GEOMETRY_TYPE_TRIANGLE : RTC_GEOMETRY_TYPE_USER);
    if (mesh)
      fillMesh(geometry, *mesh);
    else
      fillUser(geometry, shape);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
    rtcReleaseGeometry(geometry);
  }

  void commit() {
    rtcCommitScene(scene);
    if (!error.empty()) throw std::runtime_error(fmt::format("Embree: {}", error));
  }

  std::string error;
};

RayTracer::RayTracer(const Scene& scene) : scene_(scene) {
  auto embree = std::make_shared<Embree>();
  for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
    const Shape& shape = scene.shapes[i];
    if (isEmptyMesh(shape)) continue;
    embree->add(shape, static_cast<unsigned>(i));
    bounds_.extend(std::visit([](const auto& g) { return boundsOf(g); }, shape.geometry));
  }
  embree->commit();
  embree_ = std::move(embree);
}

std::optional<Hit> RayTracer::intersect(const Ray& ray) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{embreeRay(ray), {}};
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(embree_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return Hit{query.ray.tfar, query.hit.geomID, query.hit.primID, query.hit.u, query.hit.v};
}

std::optional<SurfaceHit> RayTracer::trace(const Ray& ray) const {
  const std::optional<Hit> hit = intersect(ray);
  if (!hit) return std::nullopt;
  return makeSurfaceHit(scene_, ray, *hit);
}

bool RayTracer::occluded(const Ray& ray) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay query = embreeRay(ray);
  rtcOccluded1(embree_->scene, &context, &query);
  return query.tfar < 0.0f;
}

}  // namespace lobe
