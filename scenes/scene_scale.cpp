#include "scenes/scene_scale.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/LU>

namespace lobe {
namespace {

// Within this range of exponents, products of four lengths stay well inside the range of floats.
constexpr int kSmallestExponent = -13;
constexpr int kLargestExponent = 27;

using Box = Eigen::AlignedBox3d;

struct Bounds {
  Box operator()(const TriangleMesh& mesh) const {
    Box box;
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t i : triangle) box.extend(mesh.positions[i].cast<double>());
    return box;
  }
  Box operator()(const Sphere& sphere) const { return around(sphere.centre, Vec3::Constant(sphere.radius)); }
  Box operator()(const Disk& disk) const { return around(disk.centre, disk.u.cwiseAbs() + disk.v.cwiseAbs()); }
  Box operator()(const Cylinder& cylinder) const {
    const Vec3 radius = cylinder.u.cwiseAbs() + cylinder.v.cwiseAbs();
    return around(cylinder.base, radius).merged(around(cylinder.base + cylinder.axis, radius));
  }
  Box operator()(const Instance& instance) const { return lobe::boundsOf(instance, *groups); }

  static Box around(const Vec3& centre, const Vec3& reach) {
    return {(centre - reach).cast<double>(), (centre + reach).cast<double>()};
  }

  const std::vector<Box>* groups;
};

struct Scaling {
  void operator()(TriangleMesh& mesh) const {
    for (Vec3& p : mesh.positions) p *= factor;
  }
  void operator()(Sphere& sphere) const {
    sphere.centre *= factor;
    sphere.radius *= factor;
  }
  void operator()(Disk& disk) const {
    for (Vec3* v : {&disk.centre, &disk.u, &disk.v}) *v *= factor;
  }
  void operator()(Cylinder& cylinder) const {
    for (Vec3* v : {&cylinder.base, &cylinder.u, &cylinder.v, &cylinder.axis}) *v *= factor;
  }
  void operator()(Instance& instance) const { instance.toWorld.affine() *= factor; }

  float factor;
};

Box boundsOf(const std::vector<Shape>& shapes, const std::vector<Box>& groups) {
  Box box;
  for (const Shape& shape : shapes) box.extend(std::visit(Bounds{&groups}, shape.geometry));
  return box;
}

double largestCoordinate(const Box& box) {
  return box.isEmpty() ? 0 : box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
}

/// The power of two that brings a length of this size into range; 1 for lengths within it and for zero.
float factorFor(double size) {
  if (!(size > 0)) return 1;
  const int exponent = std::ilogb(size);
  if (exponent < kSmallestExponent) return std::ldexp(1.0f, std::min(-exponent, 126));
  return exponent > kLargestExponent ? std::ldexp(1.0f, kLargestExponent - exponent) : 1.0f;
}

void scaleShapes(std::vector<Shape>& shapes, float factor) {
  for (Shape& shape : shapes) std::visit(Scaling{factor}, shape.geometry);
}

/// Scales the shapes of each group by the group's own factor and its instances by the inverse.
void scaleGroups(Scene& scene) {
  std::vector<float> factors;
  for (ShapeGroup& group : scene.groups) {
    factors.push_back(factorFor(largestCoordinate(boundsOf(group.shapes, {}))));
    if (factors.back() != 1.0f) scaleShapes(group.shapes, factors.back());
  }
  for (Shape& shape : scene.shapes)
    if (auto* instance = std::get_if<Instance>(&shape.geometry))
      instance->toWorld.linear() /= factors[static_cast<std::size_t>(instance->group)];
}

/// Brings the entries of the matrix into range, as ray directions require, and scales the lengths in the camera's frame
/// inversely. The film of an orthographic camera has the size given by the matrix.
void scaleCamera(Camera& camera, float factor) {
  auto linear = camera.toWorld.topLeftCorner<3, 3>();
  camera.toWorld.topRightCorner<3, 1>() *= factor;
  const float inRange = factorFor(linear.cwiseAbs().maxCoeff());
  linear.leftCols<2>() *= camera.kind == Camera::Kind::orthographic ? factor : inRange;
  linear.col(2) *= inRange;
  for (float* length : {&camera.apertureRadius, &camera.focusDistance, &camera.nearClip, &camera.farClip})
    *length *= factor / inRange;
}

struct LightScaling {
  void operator()(PointLight& light) const { scale(light.position, light.intensity); }
  void operator()(SpotLight& light) const { scale(light.position, light.intensity); }
  void operator()(DirectionalLight&) const {}
  void operator()(ProjectorLight& light) const {
    Rgb brightness = grey(light.scale);
    scale(light.position, brightness);
    light.scale = brightness.x();
  }

  /// Scales the intensity with the square of lengths, which keeps the irradiance.
  void scale(Vec3& position, Rgb& intensity) const {
    position *= factor;
    intensity = (intensity.cast<double>() * (static_cast<double>(factor) * factor)).cast<float>();
    if (!intensity.isFinite().all()) throw std::runtime_error("a light is too bright for the size of the scene");
  }

  float factor;
};

double largestCoordinate(const Scene& scene) {
  double largest = largestCoordinate(boundsOf(scene.shapes, boundsOfGroups(scene)));
  const auto add = [&](const Vec3& p) { largest = std::max(largest, static_cast<double>(p.cwiseAbs().maxCoeff())); };
  add(scene.camera.toWorld.topRightCorner<3, 1>());
  for (const DeltaLight& light : scene.lights)
    std::visit(
        [&](const auto& l) {
          if constexpr (requires { l.position; }) add(l.position);
        },
        light);
  return largest;
}

}  // namespace

std::vector<Eigen::AlignedBox3d> boundsOfGroups(const Scene& scene) {
  std::vector<Box> boxes;
  for (const ShapeGroup& group : scene.groups) boxes.push_back(boundsOf(group.shapes, {}));
  return boxes;
}

Eigen::AlignedBox3d boundsOf(const Instance& instance, const std::vector<Eigen::AlignedBox3d>& groups) {
  const Box& box = groups[static_cast<std::size_t>(instance.group)];
  return box.isEmpty() ? box : box.transformed(instance.toWorld.cast<double>());
}

void bringIntoRange(Scene& scene) {
  scaleGroups(scene);
  scene.scale = factorFor(largestCoordinate(scene));
  scaleCamera(scene.camera, scene.scale);
  if (scene.scale == 1.0f) return;
  scaleShapes(scene.shapes, scene.scale);
  for (DeltaLight& light : scene.lights) std::visit(LightScaling{scene.scale}, light);
}

double reachOfRays(const Scene& scene) {
  constexpr double kSphere = 4;
  return kSphere * largestCoordinate(scene);
}

double growthOfRays(const Instance& instance) {
  const Eigen::Matrix3d inverse = instance.toWorld.linear().cast<double>().inverse();
  return inverse.cwiseAbs().rowwise().sum().maxCoeff();
}

bool isTraceable(const Instance& instance, double reach) {
  return growthOfRays(instance) * std::max(1.0, reach) < kLargestInRay;
}

bool isResolved(const Eigen::AlignedBox3d& box, double reach) {
  constexpr double kPrecision = 1e-6;
  return box.sizes().maxCoeff() > kPrecision * reach;
}

}  // namespace lobe
