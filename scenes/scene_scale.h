#pragma once
// The range of lengths that can be rendered in single precision. Very large and very small scenes, whose areas and
// volumes would overflow or underflow, are rescaled.

#include <vector>

#include "scenes/scene.h"

namespace lobe {

/// Largest allowed coordinate of a vertex, camera or light. Beyond it, single precision cannot resolve the rest of the
/// scene, and Embree rejects coordinates from about 10¹⁸.
inline constexpr float kLargestCoordinate = 1e15f;

inline bool isInRange(const Vec3& position) {
  return (position.array().abs() <= kLargestCoordinate).all();
}

/// Bounding boxes of all groups in their local spaces.
std::vector<Eigen::AlignedBox3d> boundsOfGroups(const Scene& scene);
/// World-space bounding box of an instance. groups: those of boundsOfGroups.
Eigen::AlignedBox3d boundsOf(const Instance& instance, const std::vector<Eigen::AlignedBox3d>& groups);

/// Multiplies all lengths by a power of two if the largest coordinate of shapes, lights and camera is extremely large
/// or small; each group has a factor of its own, and so has the camera's frame. The picture does not change.
/// Scene::scale holds the factor. Throws std::runtime_error when the intensity of a light would overflow.
void bringIntoRange(Scene& scene);

/// Embree rejects rays whose origin or direction has an absolute component over 1.8·10¹⁸.
inline constexpr double kLargestInRay = 1e18;

/// The largest absolute coordinate of the origins of ordinary rays: surfaces, the camera, lights, and a sphere around
/// the scene on which photons from lights at infinity start.
double reachOfRays(const Scene& scene);

/// The largest factor by which components of a ray grow when it is transformed into the space of the instance's group.
double growthOfRays(const Instance& instance);

/// Whether rays of this reach can be traced in the group of the instance.
bool isTraceable(const Instance& instance, double reach);

/// Whether something with this bounding box is larger than the precision of the coordinates of rays.
bool isResolved(const Eigen::AlignedBox3d& box, double reach);

}  // namespace lobe
