#pragma once
// Scenes far from the size of a room, whose areas and volumes would leave the range of floats.

#include "scenes/scene.h"

namespace lobe {

/// No coordinate of a vertex, camera or light may be larger: what is farther off has no size beside the rest in single
/// precision, and Embree refuses coordinates from about 10¹⁸.
inline constexpr float kLargestCoordinate = 1e15f;

inline bool isInRange(const Vec3& position) {
  return (position.array().abs() <= kLargestCoordinate).all();
}

/// The box of what an instance shows of the group.
Eigen::AlignedBox3d boundsOf(const ShapeGroup& group, const Eigen::Affine3f& toWorld);

/// Multiplies all lengths by a power of two where the largest coordinate of shapes, lights and camera is not of
/// ordinary size, and those of groups each by their own; the picture stays the same. Scene::scale tells the factor.
/// Throws std::runtime_error when a light then has an intensity that is no float.
void bringIntoRange(Scene& scene);

}  // namespace lobe
