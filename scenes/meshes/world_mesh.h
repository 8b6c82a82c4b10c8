#pragma once
// Internal to scenes/: converts the mesh of a file to world-space triangles.

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// The upper left 3×3 block. Throws std::runtime_error when the transform is singular, not finite or not affine.
Eigen::Matrix3f checkedLinear(const Eigen::Matrix4f& toWorld);

/// Transforms a mesh from object space to world space and applies all options. Its texture coordinates must have v
/// downwards; flipTexCoords flips them. Missing vertex normals are computed; the front of a triangle is the side that
/// its vertex normals point to. Indices must be in range. Throws std::runtime_error when there is no triangle, a
/// number is not finite, or maxSmoothAngle takes far more than linear time; then the message names the limit.
TriangleMesh toWorldMesh(TriangleMesh mesh, const MeshOptions& options);

}  // namespace lobe
