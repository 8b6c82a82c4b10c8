#pragma once
// Rescales very large and very small scenes, whose areas and volumes would overflow or underflow in single precision.

#include "scenes/scene.h"

namespace lobe {

/// Largest allowed coordinate of a vertex, camera or light. Beyond it, single precision cannot resolve the rest of the
/// scene, and Embree rejects coordinates from about 10¹⁸.
inline constexpr float kLargestCoordinate = 1e15f;

inline bool isInRange(const Vec3& position) {
  return (position.array().abs() <= kLargestCoordinate).all();
}

/// World-space bounding box of an instance of the group.
Eigen::AlignedBox3d boundsOf(const ShapeGroup& group, const Eigen::Affine3f& toWorld);

/// Multiplies all lengths by a power of two if the largest coordinate of shapes, lights and camera is extremely large
/// or small; each group has a factor of its own. The picture does not change. Scene::scale holds the factor. Throws
/// std::runtime_error when the intensity of a light would overflow.
void bringIntoRange(Scene& scene);

}  // namespace lobe
