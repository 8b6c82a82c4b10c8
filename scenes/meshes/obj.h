#pragma once
// Wavefront OBJ files.

#include <filesystem>
#include <string>
#include <vector>

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// How a file is divided into meshes where a `g` or `usemtl` follows faces. It matters for normals that the file does
/// not give, as they are smooth over one mesh only.
enum class ObjGrouping {
  joined,    ///< all faces are one mesh, told apart by materials alone, as in Mitsuba 3
  separate,  ///< each mesh by itself, as in Mitsuba 0.6
  collapsed  ///< one mesh of the material that `usemtl` names last, as with Mitsuba 0.6's `collapse`
};

struct ObjSelection {
  std::vector<std::string> materials;  ///< to be told apart
  int mesh = -1;                       ///< which of the file's meshes, from zero; negative for all
  ObjGrouping grouping = ObjGrouping::joined;
};

/// All faces of the file as one mesh in world space; polygons are triangulated. Texture coordinates are handed out with
/// v downwards, as textures want it (see MeshOptions). The normals are the file's; where it has none (or not for all
/// corners), they are averaged over the triangles around each vertex, weighted by angle, as Mitsuba does. The front is
/// where the file's normals point or, without any, where the triangles are counter-clockwise in world space. Throws
/// std::runtime_error that names the file. Safe to call from several threads.
TriangleMesh readObj(const std::filesystem::path& path, const MeshOptions& options);

/// The same of the selected faces, with a mesh for each of the materials, of the faces that follow its `usemtl`, and a
/// last one of all other faces. A mesh is empty where there are no such faces; std::runtime_error when all are.
std::vector<TriangleMesh> readObjByMaterial(const std::filesystem::path& path, const MeshOptions& options,
                                            const ObjSelection& selection);

}  // namespace lobe
