#pragma once
// Internal to scenes/: what the readers of mesh files share.

#include <filesystem>
#include <functional>
#include <string>

#include "scenes/scene.h"

namespace lobe {

/// Hands the file's bytes to parse. What parse throws comes out as std::runtime_error that begins with the file's name,
/// as do faults of opening and reading.
TriangleMesh readMeshFile(const std::filesystem::path& path, const std::function<TriangleMesh(std::string)>& parse);

}  // namespace lobe
