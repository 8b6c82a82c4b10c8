#include "tests/faults/injection.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <map>
#include <new>
#include <variant>
#include <vector>

#include <fcntl.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <catch2/catch.hpp>

#include "runtime/image/image.h"
#include "runtime/image/image_output.h"
#include "schema/checkpoint_file.h"
#include "tests/support/tool_run.h"

namespace lobe::test {

Countdown allocations{"allocations"}, tasks{"tasks"}, writes{"writes"}, reads{"reads"};

namespace {

void* allocate(std::size_t size, std::size_t alignment) {
  size = std::max<std::size_t>(size, 1);
  void* memory = alignment == 0 ? std::malloc(size)
                                : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (!memory || allocations.fails()) {
    std::free(memory);
    throw std::bad_alloc();
  }
  return memory;
}

}  // namespace
}  // namespace lobe::test

// Not inlined, or g++ would warn that memory of operator new is given to free.
void* operator new(std::size_t size) {
  return lobe::test::allocate(size, 0);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return lobe::test::allocate(size, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  try {
    return operator new(size);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

// Libraries may lose memory when an allocation fails; the program would end then.
extern "C" const char* __asan_default_options() {  // NOLINT(bugprone-reserved-identifier,readability-identifier-naming)
  return "detect_leaks=0";
}

// These replace those of the C library for our own code and, except for fsync, for the C++ library.
extern "C" ssize_t write(int file, const void* bytes, std::size_t size) {
  if (lobe::test::writes.fails()) {
    errno = ENOSPC;
    return -1;
  }
  return ::syscall(SYS_write, file, bytes, size);
}
extern "C" int fsync(int file) {
  if (lobe::test::writes.fails()) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_fsync, file));
}
extern "C" int rename(const char* from, const char* to) noexcept {
  if (lobe::test::writes.fails()) {
    errno = EACCES;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}
extern "C" ssize_t read(int file, void* bytes, std::size_t size) {
  if (lobe::test::reads.fails()) {
    errno = EIO;
    return -1;
  }
  return ::syscall(SYS_read, file, bytes, size);
}

// These replace those of the C library for our own code only, because libraries also use them for other things than
// files that are written. The linker redirects our calls to them (--wrap in tests/CMakeLists.txt).
extern "C" {
int openOrFail(const char* path, int flags, mode_t mode) asm("__wrap_open");
int closeOrFail(int file) asm("__wrap_close");
int fchmodOrFail(int file, mode_t mode) asm("__wrap_fchmod");
}
int openOrFail(const char* path, int flags, mode_t mode) {
  if (lobe::test::writes.fails()) {
    errno = EMFILE;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}
int closeOrFail(int file) {
  const long result = ::syscall(SYS_close, file);  // also if it fails, as on Linux
  if (lobe::test::writes.fails()) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(result);
}
int fchmodOrFail(int file, mode_t mode) {
  if (lobe::test::writes.fails()) {
    errno = EPERM;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_fchmod, file, mode));
}

// The functions by which oneTBB's headers get the memory of a task. The linker redirects the calls from our code to
// those named __wrap_, and those named __real_ to oneTBB (--wrap in tests/CMakeLists.txt).
using TaskPool = tbb::detail::d1::small_object_pool;
using Execution = tbb::detail::d1::execution_data;
extern "C" {
void* realAllocateTask(TaskPool*& pool,
                       std::size_t size) asm("__real__ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm");
void* allocateTask(TaskPool*& pool,
                   std::size_t size) asm("__wrap__ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm");
void* realAllocateChild(TaskPool*& pool, std::size_t size, const Execution& execution) asm(
    "__real__ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEmRKNS2_14execution_dataE");
void* allocateChild(TaskPool*& pool, std::size_t size, const Execution& execution) asm(
    "__wrap__ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEmRKNS2_14execution_dataE");
}
void* allocateTask(TaskPool*& pool, std::size_t size) {
  if (lobe::test::tasks.fails()) throw std::bad_alloc();
  return realAllocateTask(pool, size);
}
// A task that is split gets memory for the new task and then for a node of the tree of tasks. Without the node, oneTBB
// would lose the memory of the task.
void* allocateChild(TaskPool*& pool, std::size_t size, const Execution& execution) {
  thread_local bool isNode = false;
  if (!isNode && lobe::test::tasks.fails()) throw std::bad_alloc();
  isNode = !isNode;
  return realAllocateChild(pool, size, execution);
}

namespace lobe::test {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;  // contents by name

/// The first calls, then fewer and fewer, and the last; but not the last allocation, which a destructor of a library
/// may make.
std::vector<long> chosenUpTo(long last, const Countdown& countdown) {
  std::vector<long> chosen;
  for (long n = 1; n < last; n += 1 + n / 12) chosen.push_back(n);
  if (last > 0 && &countdown != &allocations) chosen.push_back(last);
  return chosen;
}

Files filesIn(const fs::path& folder) {
  Files files;
  for (const auto& entry : fs::directory_iterator(folder))
    files.emplace(entry.path().filename().string(), readFile(entry.path()));
  return files;
}

/// Whether it is a picture that a failed render has written, complete, but of fewer samples, as it says.
bool isPartialPicture(const fs::path& file) {
  if (file.filename() != "a.exr") return file.filename() == "a.png" && readImage(file).width > 0;
  const ImageAttributes all = readAttributes(file);
  return readImage(file).width > 0 &&
         (all.contains("interrupted") || std::get<double>(all.at("samples")) < static_cast<double>(kSamples));
}

/// The bytes of a checkpoint depend on the time that it took.
bool isCheckpoint(const fs::path& file) {
  return file.extension() == ".ckpt" && !CheckpointFile::open(file).pixels().empty();
}

bool isWhole(const fs::path& file, const std::string& bytes, const Files& expected, bool succeeded) {
  const auto found = expected.find(file.filename().string());
  if (found == expected.end()) return false;  // a temporary file
  if (found->second == bytes) return true;
  try {
    return isCheckpoint(file) || (!succeeded && isPartialPicture(file));
  } catch (const std::exception&) {
    return false;
  }
}

bool areWhole(const fs::path& folder, const Files& expected, bool succeeded) {
  const Files files = filesIn(folder);
  for (const auto& [name, bytes] : files) {
    if (isWhole(folder / name, bytes, expected, succeeded)) continue;
    UNSCOPED_INFO(name << " is not complete");
    return false;
  }
  return !succeeded || files.size() == expected.size();
}

/// Returns the message of what the work throws; empty if it succeeds.
std::string attempt(Countdown& countdown, const Subject& subject, long failing) {
  fs::remove_all(subject.out);
  fs::create_directory(subject.out);
  try {
    const Injection injection(countdown, failing);
    subject.work();
    return "";
  } catch (const std::exception& error) {
    return error.what();
  }
}

/// All faults of this program so far.
struct Totals {
  int injected = 0, survived = 0;
};
Totals totals;

}  // namespace

int inject(Countdown& countdown, const Subject& subject) {
  REQUIRE(attempt(countdown, subject, 0).empty());
  const long calls = countdown.calls;
  const Files files = filesIn(subject.out);
  const std::string result = subject.result();
  const auto isRight = [&](bool succeeded) {
    return areWhole(subject.out, files, succeeded) && (!succeeded || subject.result() == result);
  };
  int injected = 0, survived = 0, reported = 0;
  for (const long n : chosenUpTo(calls, countdown)) {
    const std::string error = attempt(countdown, subject, n);
    CAPTURE(subject.name, countdown.name, n, calls, error);
    const bool right = isRight(error.empty());
    CHECK(right);
    ++injected;
    survived += right ? 1 : 0;
    reported += error.empty() ? 0 : 1;
  }
  CHECK(attempt(countdown, subject, 0).empty());
  CHECK(isRight(true));
  totals.injected += injected;
  totals.survived += survived;
  fmt::print("{}: {} of {} {} made to fail, {} survived, {} of these as errors; so far {} of {} survived\n",
             subject.name, injected, calls, countdown.name, survived, reported, totals.survived, totals.injected);
  return reported;
}

}  // namespace lobe::test
