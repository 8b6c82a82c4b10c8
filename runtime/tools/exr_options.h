#pragma once
// The options of the tools that write .exr files for how pixels are stored.

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "runtime/image/aov.h"

namespace CLI {  // NOLINT(readability-identifier-naming)
class App;
class Option;
}  // namespace CLI

namespace lobe {

/// Declares --exr-type and --exr-compression. Returns both.
std::vector<CLI::Option*> addExrOptions(CLI::App& app, ExrFormat& format);

/// Throws UsageError if the AOVs contain numbers that the compression would take for colours, and change.
void checkLossless(const ExrFormat& format, const std::set<Aov>& aovs);

/// Prints a note if values were too large for the format.
void noteClamped(const std::string& tool, const std::filesystem::path& path, std::size_t clamped,
                 const ExrFormat& format);

}  // namespace lobe
