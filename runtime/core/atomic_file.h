#pragma once
// Atomic writing of output files: a temporary file in the same folder is written completely, then renamed.

#include <filesystem>
#include <span>
#include <string>

namespace lobe {

/// Writes bytes or text to a temporary file in the folder of `path`, and renames it to `path`. If that fails, the
/// temporary file is removed, a file at `path` keeps its content, and std::runtime_error that names `path` is thrown.
/// The folder must exist. Names below /dev and /proc are refused, except for /dev/shm, because they are those of
/// devices and open files, which would be replaced instead of written to. A file that is replaced keeps its permissions
/// where the file system permits that; otherwise it is only replaced if the new one grants no more.
void writeAtomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void writeAtomically(const std::filesystem::path& path, const std::string& text);

/// Throws like writeAtomically if `path` cannot be written, and creates no file. Call it before a long computation
/// whose result is written to `path`.
void checkWritable(const std::filesystem::path& path);

/// The file that writeAtomically writes for `path`: the end of a chain of symbolic links, which need not exist. A link
/// if there are more than the system follows, and writeAtomically fails.
std::filesystem::path followLinks(std::filesystem::path path);

/// Makes the signal end the program as it does by default, but not before writeAtomically has given up or completed the
/// files that are being written, so that no temporary file remains. Also for signal handlers.
void endAfterWriting(int signal);

}  // namespace lobe
