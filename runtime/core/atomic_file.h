#pragma once
// Output files appear whole or not at all: written beside their place, then renamed.

#include <filesystem>
#include <functional>
#include <span>
#include <string>

namespace lobe {

/// Calls write with a temporary path in path's folder and renames it to path when write returns; removes it when write
/// throws. The folder is not created. Throws std::runtime_error that names path.
void writeAtomically(const std::filesystem::path& path, const std::function<void(const std::filesystem::path&)>& write);

/// The same for bytes in memory.
void writeAtomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void writeAtomically(const std::filesystem::path& path, const std::string& text);

/// Throws, as writeAtomically would, when path cannot be written; leaves nothing behind. For before hours of work.
void checkWritable(const std::filesystem::path& path);

}  // namespace lobe
