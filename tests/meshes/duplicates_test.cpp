// Removal of triangles that a mesh contains more than once.

#include <catch2/catch.hpp>

#include "scenes/meshes/duplicates.h"

using namespace lobe;

namespace {

TriangleMesh mesh(std::vector<std::array<std::uint32_t, 3>> triangles) {
  // Vertices 4 to 6 have the same positions as 0 to 2; one coordinate is −0 instead of 0.
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, -0.0f, 0}, {1, 0, 0}, {0, 1, 0}}, {}, {}, triangles};
}

}  // namespace

TEST_CASE("meshes: equal triangles are removed, also with other vertices and another first corner") {
  TriangleMesh m = mesh({{0, 1, 2}, {1, 3, 2}, {4, 5, 6}, {2, 0, 1}, {3, 2, 1}});
  CHECK(removeDuplicateTriangles(m) == 3);
  CHECK(m.triangles == mesh({{0, 1, 2}, {1, 3, 2}}).triangles);
}

TEST_CASE("meshes: triangles that face opposite sides or share an edge are kept") {
  TriangleMesh m = mesh({{0, 1, 2}, {0, 2, 1}, {1, 3, 2}, {0, 1, 3}});
  CHECK(removeDuplicateTriangles(m) == 0);
  CHECK(m.triangles.size() == 4);
}
