#pragma once
// Shapes that are not meshes: where rays meet them, what space they take, how large they are. World space or that of a
// group, as the shape is given.

#include <optional>

#include "scenes/scene.h"

namespace lobe {

/// An open line segment: distances in units of the direction's length, in (near, far].
struct Interval {
  double near, far;
  bool contains(double t) const { return t > near && t <= far; }
};

/// The nearest distance in range at which the line meets the shape from either side. In double precision: the error is
/// then that of the ray itself, at any scale.
std::optional<double> intersectShape(const Sphere& sphere, const Eigen::Vector3d& origin,
                                     const Eigen::Vector3d& direction, const Interval& range);
std::optional<double> intersectShape(const Disk& disk, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                     const Interval& range);
std::optional<double> intersectShape(const Cylinder& cylinder, const Eigen::Vector3d& origin,
                                     const Eigen::Vector3d& direction, const Interval& range);

Eigen::AlignedBox3f boundsOf(const TriangleMesh& mesh);
Eigen::AlignedBox3f boundsOf(const Sphere& sphere);
Eigen::AlignedBox3f boundsOf(const Disk& disk);
Eigen::AlignedBox3f boundsOf(const Cylinder& cylinder);

/// The point as x u + y v from the centre, in the plane of the disk, which it may be off.
Eigen::Vector2d diskCoordinates(const Disk& disk, const Eigen::Vector3d& point);

float areaOf(const Sphere& sphere);
float areaOf(const Disk& disk);
float areaOf(const Cylinder& cylinder);

}  // namespace lobe
