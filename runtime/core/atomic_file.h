#pragma once
// Atomic writing of output files: a temporary file in the same folder is written completely, then renamed.

#include <filesystem>
#include <functional>
#include <span>
#include <string>

namespace lobe {

/// Calls `write` with the path of a temporary file in the folder of `path`, and renames the file to `path` when `write`
/// returns. If `write` throws, the temporary file is removed and the exception is passed on. The folder must exist.
/// Throws std::runtime_error that names `path` if the file cannot be written.
void writeAtomically(const std::filesystem::path& path, const std::function<void(const std::filesystem::path&)>& write);

/// Writes bytes or text atomically.
void writeAtomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void writeAtomically(const std::filesystem::path& path, const std::string& text);

/// Throws like writeAtomically if `path` cannot be written, and creates no file. Call it before a long computation
/// whose result is written to `path`.
void checkWritable(const std::filesystem::path& path);

}  // namespace lobe
