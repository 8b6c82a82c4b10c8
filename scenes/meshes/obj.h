#pragma once
// Wavefront OBJ files.

#include <filesystem>
#include <string>
#include <vector>

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// How a file is split into meshes where a `g` or `usemtl` follows faces. This affects computed normals, which are
/// smooth only within one mesh.
enum class ObjGrouping {
  joined,    ///< all faces are one mesh, split by materials only, as in Mitsuba 3
  separate,  ///< every mesh is separate, as in Mitsuba 0.6
  collapsed  ///< one mesh with the material of the last `usemtl`, as with Mitsuba 0.6's `collapse`
};

struct ObjSelection {
  std::vector<std::string> materials;  ///< each gets a mesh of its own
  int mesh = -1;                       ///< index of the mesh in the file, from zero; negative for all
  ObjGrouping grouping = ObjGrouping::joined;
};

/// All faces of the file as one mesh in world space; polygons are triangulated. Texture coordinates are returned with v
/// downwards, as textures expect (see MeshOptions). Normals are those of the file; if any corner has none, they are
/// averaged over the triangles around each vertex, weighted by angle, as in Mitsuba. The front is the side that the
/// file's normals point to or, without normals, the side from which triangles are counter-clockwise in world space.
/// Throws std::runtime_error that names the file. Safe to call from several threads.
TriangleMesh readObj(const std::filesystem::path& path, const MeshOptions& options);

/// The same for the selected faces: one mesh for each of the materials, with the faces that follow its `usemtl`, and a
/// last one with all other faces. A mesh is empty if it has no faces. Throws std::runtime_error when all are empty.
std::vector<TriangleMesh> readObjByMaterial(const std::filesystem::path& path, const MeshOptions& options,
                                            const ObjSelection& selection);

}  // namespace lobe
