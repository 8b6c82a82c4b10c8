#pragma once
// Mitsuba's simple shapes. Under a mirroring transform, the front stays on the side of the transformed normal, unless
// stated otherwise. Each function throws std::runtime_error when the transform is singular, not finite or not affine.

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// [-1,1]² in the plane z = 0, front towards +z; uv runs over [0,1]² along x and y.
TriangleMesh makeRectangle(const MeshOptions& options);

/// [-1,1]³, front outwards; uv covers [0,1]² on every face.
TriangleMesh makeCube(const MeshOptions& options);

/// The unit disk in the plane z = 0, front towards +z; a general transform makes it an ellipse.
Disk makeDisk(const MeshOptions& options);

/// How the transform of a sphere is applied. old, as in Mitsuba 0.6: its scale applies to the radius alone, so that the
/// centre is only rotated and moved. today, as in Mitsuba 3 and the last releases of Mitsuba 2: the scale applies to
/// the centre, too, and a mirroring transform turns the front inwards.
enum class SphereTransform { old, today };

/// radius > 0. Throws std::runtime_error when the transform would make it an ellipsoid.
Sphere makeSphere(const Vec3& centre, float radius, const MeshOptions& options,
                  SphereTransform kind = SphereTransform::today);

/// The lateral surface of a cylinder about the segment from start to end; radius > 0. As in Mitsuba, its texture starts
/// at an arbitrary azimuth. Throws std::runtime_error when the transform does not keep it a right circular cylinder.
Cylinder makeCylinder(const Vec3& start, const Vec3& end, float radius, const MeshOptions& options);

}  // namespace lobe
