#include "runtime/render/geometry/raytracer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include "runtime/core/stopwatch.h"
#include "runtime/render/geometry/shape_geometry.h"
#include "scenes/scene_scale.h"

namespace lobe {
namespace {

template <class T>
constexpr bool kIsAnalytic = !std::is_same_v<T, TriangleMesh> && !std::is_same_v<T, Instance>;

/// Bounding box of a shape of the scene; groups: bounding boxes of the shape groups that instances refer to.
Eigen::AlignedBox3f boundsOf(const Geometry& geometry, const std::vector<Eigen::AlignedBox3f>& groups) {
  return std::visit(
      [&](const auto& g) {
        if constexpr (std::is_same_v<std::decay_t<decltype(g)>, Instance>)
          return groups[g.group].isEmpty() ? groups[g.group] : groups[g.group].transformed(g.toWorld);
        else
          return lobe::boundsOf(g);
      },
      geometry);
}

void reportBounds(const RTCBoundsFunctionArguments* args) {
  Eigen::AlignedBox3f box = boundsOf(static_cast<const Shape*>(args->geometryUserPtr)->geometry, {});
  // The box was rounded, but must contain the shape.
  const Vec3 margin = (box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs())) * 0x1p-21f;
  box = {box.min() - margin, box.max() + margin};
  *args->bounds_o = {box.min().x(), box.min().y(), box.min().z(), 0, box.max().x(), box.max().y(), box.max().z(), 0};
}

// Only single rays are traced, so the ray of a callback has the layout of RTCRay.
std::optional<double> intersectUser(const Shape& shape, const RTCRay& ray) {
  const Eigen::Vector3d origin(ray.org_x, ray.org_y, ray.org_z);
  const Eigen::Vector3d direction(ray.dir_x, ray.dir_y, ray.dir_z);
  return std::visit(
      [&](const auto& g) -> std::optional<double> {
        if constexpr (kIsAnalytic<std::decay_t<decltype(g)>>)
          return intersectShape(g, origin, direction, {ray.tnear, ray.tfar});
        else
          return std::nullopt;
      },
      shape.geometry);
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
  // Buffers that Embree allocates have the padding that its vector loads need.
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

void fillInstance(RTCGeometry geometry, const Instance& instance, RTCScene group) {
  rtcSetGeometryInstancedScene(geometry, group);
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, instance.toWorld.matrix().data());
}

RTCGeometryType geometryType(const Shape& shape) {
  if (std::holds_alternative<TriangleMesh>(shape.geometry)) return RTC_GEOMETRY_TYPE_TRIANGLE;
  return std::holds_alternative<Instance>(shape.geometry) ? RTC_GEOMETRY_TYPE_INSTANCE : RTC_GEOMETRY_TYPE_USER;
}

}  // namespace

struct RayTracer::Embree {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = nullptr;
  std::vector<RTCScene> groups;
  std::vector<Eigen::AlignedBox3f> groupBounds;
  Eigen::AlignedBox3f bounds;
  double buildSeconds = 0;
  float largest = kLargestInRay;  // absolute component of rays that can be traced, also in the groups of instances

  explicit Embree(const Scene& source) {
    if (!device) throw std::runtime_error("Embree: the device cannot be created");
    rtcSetDeviceErrorFunction(
        device,
        [](void* text, RTCError, const char* message) { *static_cast<std::string*>(text) = message ? message : "?"; },
        &error);
    for (const ShapeGroup& group : source.groups) {
      groupBounds.push_back(boundsOfAll(group.shapes));
      groups.push_back(build(group.shapes));
    }
    bounds = boundsOfAll(source.shapes);
    reach = reachOfRays(source);
    scene = build(source.shapes);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;
  ~Embree() {
    if (scene) rtcReleaseScene(scene);
    for (RTCScene group : groups) rtcReleaseScene(group);
    if (device) rtcReleaseDevice(device);
  }

  /// Whether Embree can trace the ray. Debian's aborts the program if not.
  bool accepts(const Ray& ray) const {
    // Each comparison is false for NaN.
    return (ray.origin.array().abs() <= largest && ray.direction.array().abs() <= largest).all() && ray.tfar > 0.0f;
  }

 private:
  Eigen::AlignedBox3f boundsOfAll(const std::vector<Shape>& shapes) const {
    Eigen::AlignedBox3f box;
    for (const Shape& shape : shapes) box.extend(boundsOf(shape.geometry, groupBounds));
    return box;
  }

  RTCScene build(const std::vector<Shape>& shapes) {
    RTCScene result = rtcNewScene(device);
    // Robust, so that rays do not pass through shared edges. High quality, because the scene is built once and traced
    // hundreds of millions of times.
    rtcSetSceneFlags(result, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(result, RTC_BUILD_QUALITY_HIGH);
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const Eigen::AlignedBox3f shapeBox = boundsOf(shapes[i].geometry, groupBounds);
      if (shapeBox.isEmpty() || isTooSmall(shapes[i], shapeBox)) continue;
      add(result, shapes[i], static_cast<unsigned>(i));
    }
    const Stopwatch watch;
    rtcCommitScene(result);
    buildSeconds += watch.seconds();
    if (!error.empty()) throw std::runtime_error(fmt::format("Embree: {}", error));
    return result;
  }

  /// Whether the shape is an untraceable instance smaller than the precision of coordinates, which is left out. Throws
  /// std::runtime_error for larger untraceable instances.
  bool isTooSmall(const Shape& shape, const Eigen::AlignedBox3f& shapeBox) const {
    const auto* instance = std::get_if<Instance>(&shape.geometry);
    if (!instance || isTraceable(*instance, reach)) return false;
    if (isResolved(shapeBox.cast<double>(), reach))
      throw std::runtime_error(fmt::format("shape \"{}\": the instance is too flat to be traced", shape.name));
    return true;
  }

  void add(RTCScene to, const Shape& shape, unsigned id) {
    RTCGeometry geometry = rtcNewGeometry(device, geometryType(shape));
    if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry))
      fillMesh(geometry, *mesh);
    else if (const auto* instance = std::get_if<Instance>(&shape.geometry))
      addInstance(geometry, *instance);
    else
      fillUser(geometry, shape);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(to, geometry, id);
    rtcReleaseGeometry(geometry);
  }

  void addInstance(RTCGeometry geometry, const Instance& instance) {
    fillInstance(geometry, instance, groups[instance.group]);
    largest = static_cast<float>(std::min<double>(largest, kLargestInRay / growthOfRays(instance)));
  }

  double reach = 0;  // the largest absolute coordinate of ray origins
  std::string error;
};

RayTracer::RayTracer(const Scene& scene) : scene_(scene), embree_(std::make_shared<Embree>(scene)) {}

const Eigen::AlignedBox3f& RayTracer::bounds() const {
  return embree_->bounds;
}

double RayTracer::buildSeconds() const {
  return embree_->buildSeconds;
}

std::optional<Hit> RayTracer::intersect(const Ray& ray) const {
  if (!embree_->accepts(ray)) return std::nullopt;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{embreeRay(ray), {}};
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(embree_->scene, &context, &query);
  const RTCHit& hit = query.hit;
  if (hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  const bool instanced = hit.instID[0] != RTC_INVALID_GEOMETRY_ID;
  return Hit{query.ray.tfar, instanced ? hit.instID[0] : hit.geomID, instanced ? hit.geomID : 0, hit.primID, hit.u,
             hit.v};
}

std::optional<SurfaceHit> RayTracer::trace(const Ray& ray) const {
  const std::optional<Hit> hit = intersect(ray);
  if (!hit) return std::nullopt;
  return makeSurfaceHit(scene_, ray, *hit);
}

bool RayTracer::occluded(const Ray& ray) const {
  if (!embree_->accepts(ray)) return false;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay query = embreeRay(ray);
  rtcOccluded1(embree_->scene, &context, &query);
  return query.tfar < 0.0f;
}

}  // namespace lobe
