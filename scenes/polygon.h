#pragma once
// Internal to scenes/: polygons into triangles.

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace lobe {

/// Divides a polygon of n ≥ 3 corners, nearly flat, into n − 2 triangles of its corners, wound like it, by clipping
/// ears. Of a convex one it makes the fan about the first corner; one that crosses itself is divided somehow.
std::vector<std::array<std::size_t, 3>> triangulate(const std::vector<Eigen::Vector3d>& corners);

}  // namespace lobe
