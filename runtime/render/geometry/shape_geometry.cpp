#include "runtime/render/geometry/shape_geometry.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/core/sampling.h"

namespace lobe {
namespace {

using Vec3d = Eigen::Vector3d;

// Half the bounding box of an ellipse with conjugate radii u and v: the largest |cosφ u + sinφ v| along each axis.
Vec3 extentOfEllipse(const Vec3& u, const Vec3& v) {
  return (u.cast<double>().array().square() + v.cast<double>().array().square()).sqrt().cast<float>();
}

}  // namespace

std::optional<double> intersectShape(const Sphere& sphere, const Vec3d& origin, const Vec3d& direction,
                                     const Interval& range) {
  // Computing the discriminant from the distance between centre and line avoids cancellation (Haines et al. 2019).
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

std::optional<double> intersectShape(const Disk& disk, const Vec3d& origin, const Vec3d& direction,
                                     const Interval& range) {
  const Vec3d u = disk.u.cast<double>();
  const Vec3d v = disk.v.cast<double>();
  const Vec3d normal = u.cross(v);
  const Vec3d centre = disk.centre.cast<double>();
  const double t = (centre - origin).dot(normal) / direction.dot(normal);
  if (!range.contains(t)) return std::nullopt;  // also if the ray is parallel to the plane and t is NaN
  const Eigen::Vector2d p = diskCoordinates(disk, origin + t * direction);
  if (!(p.squaredNorm() <= 1.0)) return std::nullopt;  // also if the ray is parallel to the plane and t is infinite
  return t;
}

Eigen::Vector2d diskCoordinates(const Disk& disk, const Vec3d& point) {
  const Vec3d u = disk.u.cast<double>(), v = disk.v.cast<double>();
  const Vec3d p = point - disk.centre.cast<double>();
  const Vec3d normal = u.cross(v);
  return Eigen::Vector2d(p.cross(v).dot(normal), u.cross(p).dot(normal)) / normal.squaredNorm();
}

std::optional<double> intersectShape(const Cylinder& cylinder, const Vec3d& origin, const Vec3d& direction,
                                     const Interval& range) {
  // Coordinates in units of the radius across the axis, and of the length along it.
  Eigen::Matrix3d axes;
  axes << cylinder.u.cast<double>(), cylinder.v.cast<double>(), cylinder.axis.cast<double>();
  const Vec3d squares = axes.colwise().squaredNorm();
  const Vec3d o = (axes.transpose() * (origin - cylinder.base.cast<double>())).cwiseQuotient(squares);
  const Vec3d d = (axes.transpose() * direction).cwiseQuotient(squares);
  const double a = d.head<2>().squaredNorm();
  if (!(a > 0.0)) return std::nullopt;
  const double nearest = -o.head<2>().dot(d.head<2>()) / a;
  const double discriminant = 1.0 - (o.head<2>() + nearest * d.head<2>()).squaredNorm();
  if (discriminant < 0.0) return std::nullopt;
  const double half = std::sqrt(discriminant / a);
  for (const double t : {nearest - half, nearest + half}) {
    const double height = o.z() + t * d.z();
    if (range.contains(t) && height >= 0.0 && height <= 1.0) return t;
  }
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
  const Vec3 r = extentOfEllipse(disk.u, disk.v);
  return {disk.centre - r, disk.centre + r};
}

Eigen::AlignedBox3f boundsOf(const Cylinder& cylinder) {
  const Vec3 r = extentOfEllipse(cylinder.u, cylinder.v);
  Eigen::AlignedBox3f box(cylinder.base - r, cylinder.base + r);
  return box.extend(box.translated(cylinder.axis));
}

float areaOf(const Sphere& sphere) {
  return 4.0f * kPi * sphere.radius * sphere.radius;
}

float areaOf(const Disk& disk) {
  return static_cast<float>(std::numbers::pi * disk.u.cast<double>().cross(disk.v.cast<double>()).norm());
}

float areaOf(const Cylinder& cylinder) {
  return 2.0f * kPi * cylinder.u.norm() * cylinder.axis.norm();
}

}  // namespace lobe
