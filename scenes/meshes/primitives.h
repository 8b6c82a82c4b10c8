#pragma once
// Mitsuba's simple shapes. A transform that mirrors keeps the front where the transformed normal points. Each throws
// std::runtime_error when the transform is singular, not finite or not affine.

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// [-1,1]² in the plane z = 0, front towards +z; uv runs over [0,1]² along x and y.
TriangleMesh makeRectangle(const MeshOptions& options);

/// [-1,1]³, front outwards; uv covers [0,1]² on every face.
TriangleMesh makeCube(const MeshOptions& options);

/// The unit disk in the plane z = 0, front towards +z; any transform makes an ellipse of it.
Disk makeDisk(const MeshOptions& options);

/// radius > 0. std::runtime_error: the transform makes an ellipsoid of it.
Sphere makeSphere(const Vec3& centre, float radius, const MeshOptions& options);

/// The side of a cylinder about the segment from start to end; radius > 0. As Mitsuba's, its texture starts at an
/// azimuth of no meaning. std::runtime_error: the transform does not keep it a right circular cylinder.
Cylinder makeCylinder(const Vec3& start, const Vec3& end, float radius, const MeshOptions& options);

}  // namespace lobe
