#pragma once
// Mitsuba's serialized meshes: files with several zlib-compressed meshes and a table of their offsets.

#include <filesystem>

#include "scenes/meshes/mesh_budget.h"
#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe {

/// Reads mesh number `index`, from zero, of a file of version 3 or 4 in single or double precision: positions, normals
/// and texture coordinates (v downwards, see MeshOptions); vertex colours are ignored. A mesh with the face-normals
/// flag is read without normals. Throws std::runtime_error that names the file, also if the mesh has more triangles and
/// vertices than MeshBudget accepts for a scene with this file alone, which is known before they are decompressed;
/// harmless: the number that is accepted whatever the size of the file. Safe to call from several threads.
TriangleMesh readSerialized(const std::filesystem::path& path, int index, const MeshOptions& options,
                            std::uintmax_t harmless = MeshBudget::kHarmless);

}  // namespace lobe
