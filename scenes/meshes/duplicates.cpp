#include "scenes/meshes/duplicates.h"

#include <algorithm>
#include <array>
#include <set>
#include <vector>

namespace lobe {
namespace {

using Point = std::array<float, 3>;
using Corners = std::array<Point, 3>;

/// The corners of a triangle, beginning with the smallest. Adding zero makes −0 and 0 equal.
Corners cornersOf(const TriangleMesh& mesh, const std::array<std::uint32_t, 3>& triangle) {
  Corners corners;
  std::ranges::transform(triangle, corners.begin(), [&](std::uint32_t vertex) {
    const Vec3& p = mesh.positions[vertex];
    return Point{p.x() + 0.0f, p.y() + 0.0f, p.z() + 0.0f};
  });
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

}  // namespace

std::size_t removeDuplicateTriangles(TriangleMesh& mesh) {
  std::set<Corners> seen;
  return std::erase_if(mesh.triangles,
                       [&](const auto& triangle) { return !seen.insert(cornersOf(mesh, triangle)).second; });
}

}  // namespace lobe
