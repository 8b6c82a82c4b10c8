#pragma once
// Triangles that a mesh contains more than once.

#include <cstddef>

#include "scenes/scene.h"

namespace lobe {

/// Removes each triangle that has the same positions in the same order, up to rotation, as an earlier one of the mesh.
/// Returns how many were removed. Triangles that face the opposite side are kept.
std::size_t removeDuplicateTriangles(TriangleMesh& mesh);

}  // namespace lobe
