#pragma once
// What --check prints.

#include <cstdio>
#include <filesystem>

#include "scenes/mitsuba/reader.h"

namespace lobe {

/// Reads the scene as readScene does and prints all that it finds, as lines or as one JSON object. Throws
/// std::runtime_error that counts the faults when readScene with the same options would refuse the scene.
void reportCheck(const std::filesystem::path& scene, const ReadOptions& options, bool json, std::FILE* out);

}  // namespace lobe
