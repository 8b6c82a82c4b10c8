#pragma once
// The options of the tools that write .exr files for how pixels are stored.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "runtime/image/image_output.h"

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
class Option;
}  // namespace CLI

namespace lobe {

/// Declares --exr-type and --exr-compression. Returns both.
std::vector<CLI::Option*> addExrOptions(CLI::App& app, ExrFormat& format);

/// Prints a note if values were too large for the format.
void noteClamped(const std::string& tool, const std::filesystem::path& path, std::size_t clamped,
                 const ExrFormat& format);

}  // namespace lobe
