#pragma once
// Meshes in files, whatever their format.

#include <filesystem>
#include <string>
#include <vector>

#include "scenes/meshes/mesh_options.h"
#include "scenes/meshes/obj.h"
#include "scenes/scene.h"

namespace lobe {

struct MeshSource {
  std::string type;  ///< obj, ply or serialized
  std::filesystem::path path;
  int index = 0;     ///< which of the meshes in a serialized file
  ObjSelection obj;  ///< of an OBJ
};

/// Reads the mesh into the world: one for each of the OBJ's materials, of its faces (empty when there are none), then
/// one of the rest. Throws std::runtime_error that names the file. Safe to call from several threads.
std::vector<TriangleMesh> readMeshes(const MeshSource& source, const MeshOptions& options);

}  // namespace lobe
