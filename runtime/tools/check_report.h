#pragma once
// The report that --check prints.

#include <cstdio>
#include <filesystem>

#include "scenes/mitsuba/reader.h"

namespace lobe {

/// Reads the scene as readScene does and prints all faults, warnings and notes, as text or as one JSON object. Throws
/// std::runtime_error with the number of faults if readScene with the same options would fail.
void reportCheck(const std::filesystem::path& scene, const ReadOptions& options, bool json, std::FILE* out);

}  // namespace lobe
