#include "runtime/core/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace lobe {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void refuse(const fs::path& path, int error) {
  throw std::runtime_error(fmt::format("{}: cannot write: {}", path.string(), std::strerror(error)));
}

constexpr int kMostLinks = 40;  // the limit of Linux

/// The name to which a symbolic link leads; nullopt if it is none.
std::optional<fs::path> targetOfLink(const fs::path& path) {
  std::error_code error;
  const fs::path next = fs::read_symlink(path, error);
  if (error) return std::nullopt;
  return path.parent_path() / next;  // an absolute target replaces the folder
}

/// Whether the path is below /dev or /proc, except for /dev/shm, where files are ordinary ones.
bool isSystemName(const fs::path& path) {
  std::error_code error;
  const std::string folder = fs::weakly_canonical(fs::absolute(path, error).parent_path(), error).string() + "/";
  return folder.starts_with("/proc/") || (folder.starts_with("/dev/") && !folder.starts_with("/dev/shm/"));
}

/// Whether the path is such a name, or leads to one. /dev/stdout may lead on to a regular file, which would be replaced
/// instead of written to.
bool leadsToSystemName(fs::path path) {
  for (int i = 0; i <= kMostLinks; ++i) {
    if (isSystemName(path)) return true;
    const std::optional<fs::path> next = targetOfLink(path);
    if (!next) break;
    path = *next;
  }
  return false;
}

/// The file to replace: symbolic links are followed, including those to files that do not exist yet. Throws unless it
/// is a regular file or absent, so that `-o /dev/null` does not replace the device, and if a name below /dev or /proc
/// is on the way.
fs::path targetOf(const fs::path& path) {
  std::error_code error;
  fs::path target = followLinks(path);
  if (fs::is_symlink(fs::symlink_status(target, error))) refuse(path, ELOOP);
  const fs::file_status status = fs::status(target, error);
  if (error == std::errc::filename_too_long) refuse(path, ENAMETOOLONG);
  if (fs::is_directory(status)) throw std::runtime_error(path.string() + ": cannot write: is a directory");
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw std::runtime_error(path.string() + ": cannot write: not a regular file");
  if (leadsToSystemName(path))
    throw std::runtime_error(path.string() + ": cannot write: files below /dev and /proc are not replaced");
  return target;
}

/// The signal that will end the program when there are no temporary files any more (0: none), and the number of these.
std::atomic<int> endingSignal = 0, temporaries = 0;
static_assert(std::atomic<int>::is_always_lock_free, "signal handlers use them");

void endBy(int signal) {
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

/// A writer counts its file before it looks at endingSignal, so that none is created after the program has seen none.
extern "C" void endWithoutTemporaries(int signal) {
  endingSignal = signal;
  if (temporaries == 0) endBy(signal);
}

/// While it exists, endWithoutTemporaries does not end the program; the last one does so when it is destroyed.
class SignalsDeferred {
 public:
  SignalsDeferred() { ++temporaries; }
  SignalsDeferred(const SignalsDeferred&) = delete;
  SignalsDeferred& operator=(const SignalsDeferred&) = delete;
  ~SignalsDeferred() {
    if (--temporaries == 0 && endingSignal != 0) endBy(endingSignal);
  }
};

/// A file beside target that is removed unless it replaces target. If a signal is going to end the program, it is not
/// written on, and errors are thrown.
class Temporary {
 public:
  /// Creates an empty file. path names the target in messages.
  Temporary(const fs::path& target, const fs::path& path) : target_(target), path_(path) {
    static std::atomic<unsigned> counter = 0;
    refuseIfEnding();
    do {
      temporary_ = target.parent_path() / nameFor(target, counter++);
      file_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    } while (file_ < 0 && errno == EEXIST);
    if (file_ < 0) refuse(path_, errno);
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  ~Temporary() {
    close();
    if (!replaced_) ::unlink(temporary_.c_str());
  }

  /// Gives the file the permissions of the file that it replaces, if there is one. Some file systems refuse this, such
  /// as FAT drives and network folders that are mounted by another user; then the content is more important, unless the
  /// file would grant more than the one that it replaces.
  void keepPermissions() const {
    struct stat replaced, own;
    if (::stat(target_.c_str(), &replaced) != 0) return;
    if (::fstat(file_, &own) != 0) refuse(path_, errno);
    if (replaced.st_mode == own.st_mode || ::fchmod(file_, replaced.st_mode & 07777) == 0) return;
    const int error = errno;
    if ((own.st_mode & ~replaced.st_mode & 0777) != 0) refuse(path_, error);
  }

  void write(std::span<const std::byte> bytes) {
    constexpr std::size_t kBlock = 1 << 24;  // between which signals are noticed
    while (!bytes.empty()) {
      refuseIfEnding();
      const ssize_t written = ::write(file_, bytes.data(), std::min(bytes.size(), kBlock));
      if (written >= 0)
        bytes = bytes.subspan(static_cast<std::size_t>(written));
      else if (errno != EINTR)
        refuse(path_, errno);
    }
  }

  void replaceTarget() {
    // Waits until the content is on the disk. Otherwise a power failure could preserve the rename but lose the content.
    if (::fsync(file_) != 0 && errno != EINVAL) refuse(path_, errno);
    if (close() != 0) refuse(path_, errno);
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) refuse(path_, errno);
    replaced_ = true;
  }

 private:
  /// A hidden name that begins like the target's; it is shortened, because the target's name may have the maximum
  /// length already.
  static std::string nameFor(const fs::path& target, unsigned number) {
    constexpr std::size_t kMaxLength = 255;
    const std::string unique = fmt::format(".{}-{}", ::getpid(), number);
    return fmt::format(".{}{}", target.filename().string().substr(0, kMaxLength - 1 - unique.size()), unique);
  }

  void refuseIfEnding() const {
    if (endingSignal != 0) refuse(path_, EINTR);
  }

  int close() { return file_ < 0 ? 0 : ::close(std::exchange(file_, -1)); }

  const SignalsDeferred deferred_;  // first, so that the file is removed before
  fs::path target_, path_, temporary_;
  int file_ = -1;
  bool replaced_ = false;
};

}  // namespace

fs::path followLinks(fs::path path) {
  for (int i = 0; i < kMostLinks; ++i) {
    const std::optional<fs::path> next = targetOfLink(path);
    if (!next) break;
    path = *next;
  }
  return path;
}

void writeAtomically(const fs::path& path, std::span<const std::byte> bytes) {
  Temporary temporary(targetOf(path), path);
  temporary.keepPermissions();
  temporary.write(bytes);
  temporary.replaceTarget();
}

void writeAtomically(const fs::path& path, const std::string& text) {
  writeAtomically(path, std::as_bytes(std::span(text)));
}

void checkWritable(const fs::path& path) {
  const Temporary created(targetOf(path), path);
  created.keepPermissions();
}

void endAfterWriting(int signal) {
  struct sigaction action {};
  action.sa_handler = endWithoutTemporaries;
  action.sa_flags = SA_RESTART;
  ::sigaction(signal, &action, nullptr);
}

}  // namespace lobe
