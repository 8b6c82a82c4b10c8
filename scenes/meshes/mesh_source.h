#pragma once
// Reads mesh files of all formats.

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
  int index = 0;     ///< of the mesh in a serialized file
  ObjSelection obj;  ///< for OBJ files
};

/// Reads a file as world-space meshes: for an OBJ, one mesh for each of the selected materials (empty if no face uses
/// it), then one for the remaining faces; otherwise a single mesh. Throws std::runtime_error that names the file. Safe
/// to call from several threads.
std::vector<TriangleMesh> readMeshes(const MeshSource& source, const MeshOptions& options);

}  // namespace lobe
