#pragma once
// Stanford PLY files.

#include <filesystem>

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// Reads ASCII and binary files of either byte order: vertices with x, y, z and, if all of them are there, nx, ny, nz
/// and texture coordinates (u, v or s, t or texture_u, texture_v); faces with vertex_indices (or vertex_index), which
/// are triangulated, and a pair of texture coordinates for each corner in a list texcoord (or texture_uv, as MeshLab
/// writes them), which count instead of those of vertices. Other elements and properties are passed over. Normals and
/// the front as in readObj; v is taken to count downwards (see MeshOptions). Throws std::runtime_error that names the
/// file. Safe to call from several threads.
TriangleMesh readPly(const std::filesystem::path& path, const MeshOptions& options);

}  // namespace lobe
