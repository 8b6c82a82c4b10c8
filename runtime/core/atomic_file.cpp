#include "runtime/core/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

namespace lobe {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void refuse(const fs::path& path, int error) {
  throw std::runtime_error(fmt::format("{}: cannot write: {}", path.string(), std::strerror(error)));
}

/// The end of a chain of symbolic links, which need not exist.
fs::path followLinks(fs::path path) {
  constexpr int kMostLinks = 40;  // the limit of Linux
  std::error_code error;
  for (int i = 0; i < kMostLinks; ++i) {
    const fs::path next = fs::read_symlink(path, error);
    if (error) return path;
    path = path.parent_path() / next;  // an absolute target replaces the folder
  }
  refuse(path, ELOOP);
}

/// The file to replace: symbolic links are followed, including those to files that do not exist yet. Throws unless it
/// is a regular file or absent, so that `-o /dev/null` does not replace the device.
fs::path targetOf(const fs::path& path) {
  std::error_code error;
  fs::path target = followLinks(path);
  const fs::file_status status = fs::status(target, error);
  if (fs::is_directory(status)) throw std::runtime_error(path.string() + ": cannot write: is a directory");
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw std::runtime_error(path.string() + ": cannot write: not a regular file");
  return target;
}

/// Creates an empty temporary file in the folder of target, with the same extension, from which writers may derive the
/// format.
fs::path createBeside(const fs::path& target, const fs::path& path) {
  static std::atomic<unsigned> counter = 0;
  for (;;) {
    fs::path candidate = target.parent_path() / fmt::format(".{}.{}-{}{}", target.stem().string(), ::getpid(),
                                                            counter++, target.extension().string());
    const int file = ::open(candidate.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file >= 0) {
      ::close(file);
      return candidate;
    }
    if (errno != EEXIST) refuse(path, errno);
  }
}

/// Waits until the content is on the disk. Otherwise a power failure could preserve the rename but lose the content.
void flushToDisk(const fs::path& temporary, const fs::path& path) {
  const int file = ::open(temporary.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) refuse(path, errno);
  const int error = ::fsync(file) == 0 ? 0 : errno;
  ::close(file);
  if (error != 0 && error != EINVAL) refuse(path, error);
}

void writeAll(const fs::path& temporary, std::span<const std::byte> bytes, const fs::path& path) {
  const int file = ::open(temporary.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (file < 0) refuse(path, errno);
  int error = 0;
  while (!bytes.empty() && error == 0) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written >= 0)
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    else if (errno != EINTR)
      error = errno;
  }
  if (::close(file) != 0 && error == 0) error = errno;
  if (error != 0) refuse(path, error);
}

}  // namespace

void writeAtomically(const fs::path& path, const std::function<void(const fs::path&)>& write) {
  const fs::path target = targetOf(path);
  const fs::path temporary = createBeside(target, path);
  try {
    write(temporary);
    flushToDisk(temporary, path);
    if (::rename(temporary.c_str(), target.c_str()) != 0) refuse(path, errno);
  } catch (...) {
    ::unlink(temporary.c_str());
    throw;
  }
}

void writeAtomically(const fs::path& path, std::span<const std::byte> bytes) {
  writeAtomically(path, [&](const fs::path& temporary) { writeAll(temporary, bytes, path); });
}

void writeAtomically(const fs::path& path, const std::string& text) {
  writeAtomically(path, std::as_bytes(std::span(text)));
}

void checkWritable(const fs::path& path) {
  ::unlink(createBeside(targetOf(path), path).c_str());
}

}  // namespace lobe
