#pragma once
// Intersections, bounds and areas of shapes, in the space in which the shape is given: world space or that of a group.
// Meshes are intersected by Embree.

#include <optional>

#include "scenes/scene.h"

namespace lobe {

/// A half-open interval (near, far] of distances along a line, in units of the direction's length.
struct Interval {
  double near, far;
  bool contains(double t) const { return t > near && t <= far; }
};

/// The nearest distance in range at which the line hits the shape from either side; nullopt without a hit. Computed in
/// double precision, so that the error is that of the ray itself at any scale.
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

/// Coordinates (x, y) of a point that is projected onto the plane of the disk: centre + x u + y v.
Eigen::Vector2d diskCoordinates(const Disk& disk, const Eigen::Vector3d& point);

float areaOf(const Sphere& sphere);
float areaOf(const Disk& disk);
float areaOf(const Cylinder& cylinder);

}  // namespace lobe
