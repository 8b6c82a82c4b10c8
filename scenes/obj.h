#pragma once
// Wavefront OBJ files.

#include <filesystem>
#include <string>
#include <vector>

#include "scenes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// All faces of the file as one mesh in world space; polygons are triangulated, groups and materials ignored. Texture
/// coordinates are handed out with v downwards, as textures want it (see MeshOptions). The normals are the file's;
/// where it has none (or not for all corners), they are averaged over the triangles around each vertex, weighted by
/// angle, as Mitsuba does. The front is where the file's normals point or, without any, where the triangles are
/// counter-clockwise in world space. Throws std::runtime_error that names the file. Safe to call from several threads.
TriangleMesh readObj(const std::filesystem::path& path, const MeshOptions& options);

/// The same with a mesh for each of the materials, of the faces that follow its `usemtl`, and a last one of all other
/// faces. A mesh is empty where the file has no such faces.
std::vector<TriangleMesh> readObjByMaterial(const std::filesystem::path& path, const MeshOptions& options,
                                            const std::vector<std::string>& materials);

}  // namespace lobe
