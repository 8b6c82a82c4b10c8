#pragma once
// Mitsuba's own mesh files: several meshes, each compressed by zlib, and a table of where they begin.

#include <filesystem>

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// Reads mesh number `index`, from zero, of a file of version 3 or 4 in single or double precision: positions, normals
/// and texture coordinates (v downwards, see MeshOptions); colours are passed over. A mesh that says its faces are flat
/// is read without normals. Throws std::runtime_error that names the file. Safe to call from several threads.
TriangleMesh readSerialized(const std::filesystem::path& path, int index, const MeshOptions& options);

}  // namespace lobe
