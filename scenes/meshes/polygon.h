#pragma once
// Internal to scenes/: polygons into triangles.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "scenes/scene.h"

namespace lobe {

/// Divides a polygon of n ≥ 3 corners, nearly flat, into n − 2 triangles of its corners, wound like it, by clipping
/// ears in O(n²). Of a convex one it makes the fan about the first corner; one that crosses itself is divided somehow.
std::vector<std::array<std::size_t, 3>> triangulate(const std::vector<Eigen::Vector3d>& corners);

/// Appends the triangles of a polygon, given by three or more indices of the mesh's vertices, of which the positions
/// are there already.
void appendPolygon(TriangleMesh& mesh, std::span<const std::uint32_t> corners);

}  // namespace lobe
