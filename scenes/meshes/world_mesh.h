#pragma once
// Internal to scenes/: from what a file says to world-space triangles.

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// The upper left 3×3 block. Throws std::runtime_error when the transform is singular, not finite or not affine.
Eigen::Matrix3f checkedLinear(const Eigen::Matrix4f& toWorld);

/// Takes a mesh in object space, with v already downwards unless flipTexCoords asks for the contrary, into the world,
/// and applies all options. Vertex normals that are missing are computed; the front of a triangle is where its vertex
/// normals point. Indices must be in range. Throws std::runtime_error when there is no triangle or a number is not
/// finite.
TriangleMesh toWorldMesh(TriangleMesh mesh, const MeshOptions& options);

}  // namespace lobe
