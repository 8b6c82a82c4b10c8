#pragma once
// Internal to scenes/: triangulation of polygons.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "scenes/scene.h"

namespace lobe {

/// Triangulates a nearly planar polygon with n ≥ 3 finite corners by ear clipping: n − 2 triangles of its corners with
/// the same winding. A convex polygon becomes the fan about its first corner; the result for a self-intersecting
/// polygon is unspecified. It usually takes O(n log n); where it would take far longer than that, std::runtime_error
/// with the limit is thrown.
std::vector<std::array<std::size_t, 3>> triangulate(const std::vector<Eigen::Vector3d>& corners);

/// Appends the triangles of a polygon, given by three or more indices of vertices whose positions are in the mesh
/// already. Throws std::runtime_error if they are not finite, and like triangulate.
void appendPolygon(TriangleMesh& mesh, std::span<const std::uint32_t> corners);

}  // namespace lobe
