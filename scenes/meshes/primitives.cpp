#include "scenes/meshes/primitives.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "runtime/core/frame.h"
#include "scenes/meshes/world_mesh.h"
#include "scenes/scene_scale.h"

namespace lobe {
namespace {

// Rotations are often written with six digits.
constexpr float kTolerance = 1e-4f;

/// Appends the square centre ± s ± t with texture coordinates from 0 to 1, u along s and v along t. front: its normal,
/// unit, along s × t or against it.
void addSquare(TriangleMesh& mesh, const Vec3& centre, const Vec3& s, const Vec3& t, const Vec3& front) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const Vec2& uv : {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1), Vec2(0, 1)}) {
    mesh.positions.push_back(centre + (2 * uv.x() - 1) * s + (2 * uv.y() - 1) * t);
    mesh.normals.push_back(front);
    mesh.uvs.push_back(uv);
  }
  const bool reversed = s.cross(t).dot(front) < 0;
  for (const std::uint32_t i : {first + 1, first + 2})
    mesh.triangles.push_back(reversed ? std::array{first, i + 1, i} : std::array{first, i, i + 1});
}

// In double precision, because squares of lengths may exceed the range of floats.
bool isCircle(const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
  const double square = u.squaredNorm();
  return std::abs(v.squaredNorm() - square) <= 2 * kTolerance * square && std::abs(u.dot(v)) <= kTolerance * square;
}

bool mirrors(const Eigen::Matrix3f& linear) {
  return linear.cast<double>().determinant() < 0;
}

/// The faces are flat, so their vertex normals are also correct for faceNormals, and they preserve the front under
/// mirroring.
TriangleMesh finish(TriangleMesh mesh, MeshOptions options) {
  options.faceNormals = false;
  return toWorldMesh(std::move(mesh), options);
}

/// reach: how far the shape extends along each axis.
void requireInRange(const Vec3& centre, const Vec3& reach) {
  if (!isInRange(centre.cwiseAbs() + reach.cwiseAbs()))
    throw std::runtime_error(fmt::format("coordinates over {:g} in the world are not supported", kLargestCoordinate));
}

}  // namespace

TriangleMesh makeRectangle(const MeshOptions& options) {
  TriangleMesh mesh;
  addSquare(mesh, Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ());
  return finish(std::move(mesh), options);
}

TriangleMesh makeCube(const MeshOptions& options) {
  TriangleMesh mesh;
  const auto addFace = [&](const Vec3& front, const Vec3& u, const Vec3& v) { addSquare(mesh, front, u, v, front); };
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  // The texture coordinates of Mitsuba's cube.
  addFace(-y, z, x);
  addFace(y, -x, -z);
  addFace(x, y, -z);
  addFace(z, y, x);
  addFace(-x, y, z);
  addFace(-z, -y, x);
  return finish(std::move(mesh), options);
}

Disk makeDisk(const MeshOptions& options) {
  const Eigen::Matrix3f linear = checkedLinear(options.toWorld);
  const Vec3 centre = options.toWorld.topRightCorner<3, 1>(), u = linear.col(0), v = linear.col(1);
  requireInRange(centre, u.cwiseAbs() + v.cwiseAbs());
  return {centre, u, v, mirrors(linear) != options.flipNormals};
}

Sphere makeSphere(const Vec3& centre, float radius, const MeshOptions& options, SphereTransform kind) {
  if (!(radius > 0) || !std::isfinite(radius) || !centre.allFinite())
    throw std::runtime_error("a sphere needs a finite centre and a radius above zero");
  const Eigen::Matrix3f linear = checkedLinear(options.toWorld);
  const Eigen::Matrix3d squares = linear.cast<double>().transpose() * linear.cast<double>();
  const double square = squares.trace() / 3;
  if (!((squares - square * Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 2 * kTolerance * square))
    throw std::runtime_error("a sphere's transform must scale uniformly: ellipsoids are not supported");
  const auto scale = static_cast<float>(std::sqrt(square));
  const Eigen::Matrix3f axes = linear / scale;
  const Vec3 placed = (kind == SphereTransform::old ? axes : linear) * centre + options.toWorld.topRightCorner<3, 1>();
  requireInRange(placed, Vec3::Constant(radius * scale));
  const bool turned = kind == SphereTransform::today && mirrors(linear);
  return {placed, radius * scale, options.flipNormals != turned, axes};
}

Cylinder makeCylinder(const Vec3& start, const Vec3& end, float radius, const MeshOptions& options) {
  const Vec3 along = end - start;
  if (!(radius > 0) || !std::isfinite(radius) || !start.allFinite() || !end.allFinite() || along.isZero(0))
    throw std::runtime_error("a cylinder needs two different finite ends and a radius above zero");
  const Frame frame = Frame::fromNormal(along.cast<double>().normalized().cast<float>());
  const Eigen::Matrix3f linear = checkedLinear(options.toWorld);
  const Vec3 u = linear * (radius * frame.s), v = linear * (radius * frame.t), axis = linear * along;
  const auto upright = [&](const Vec3& edge) {
    const Eigen::Vector3d e = edge.cast<double>(), a = axis.cast<double>();
    return std::abs(e.dot(a)) <= kTolerance * e.norm() * a.norm();
  };
  if (!isCircle(u.cast<double>(), v.cast<double>()) || !upright(u) || !upright(v))
    throw std::runtime_error(
        "a cylinder's transform must keep it circular and upright: elliptic and oblique ones are not supported");
  const Vec3 base = linear * start + options.toWorld.topRightCorner<3, 1>();
  requireInRange(base, u.cwiseAbs() + v.cwiseAbs() + axis.cwiseAbs());
  return {base, u, v, axis, options.flipNormals};
}

}  // namespace lobe
