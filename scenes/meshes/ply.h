#pragma once
// Stanford PLY files.

#include <filesystem>

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// Reads ASCII and binary files of either byte order: vertices with x, y, z and, if complete, nx, ny, nz and texture
/// coordinates (u, v or s, t or texture_u, texture_v); faces with vertex_indices (or vertex_index), which are
/// triangulated, and a pair of texture coordinates for each corner in a list texcoord (or texture_uv, as written by
/// MeshLab), which override those of vertices. Other elements and properties are ignored. Normals and front are
/// determined as in readObj; v counts downwards (see MeshOptions). Throws std::runtime_error that names the file. Safe
/// to call from several threads.
TriangleMesh readPly(const std::filesystem::path& path, const MeshOptions& options);

}  // namespace lobe
