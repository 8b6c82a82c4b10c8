#pragma once
// Meshes in files, whatever their format.

#include <filesystem>
#include <string>

#include "scenes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

struct MeshSource {
  std::string type;  ///< obj, ply or serialized
  std::filesystem::path path;
  int index = 0;  ///< which of the meshes in a serialized file
};

/// Reads the mesh into the world. Throws std::runtime_error that names the file. Safe to call from several threads.
TriangleMesh readMesh(const MeshSource& source, const MeshOptions& options);

}  // namespace lobe
