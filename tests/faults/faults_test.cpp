// Fault injection: the n-th allocation, or the n-th write to a file, fails while a cache is compiled and while a tiny
// scene is read, trained, rendered and written. Whatever n is, the failure is reported as an exception, nothing is
// half-written, and a run that reports success has the same bytes as one without faults.

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <new>
#include <set>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <catch2/catch.hpp>

#include "fitter/compile.h"
#include "runtime/image/image.h"
#include "runtime/image/image_output.h"
#include "runtime/tools/render_run.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_lobes.h"
#include "schema/checkpoint_file.h"
#include "schema/illumination_file.h"
#include "tests/support/loberender_test_tools.h"

namespace {

/// Calls that are counted while an Injection exists; call number `failing` fails.
struct Countdown {
  std::atomic<long> calls = 0, failing = 0;
  std::atomic<bool> enabled = false;

  bool fails() { return enabled && ++calls == failing; }
};
Countdown allocations, writes;

class Injection {
 public:
  /// failing: number of the call that fails, from 1; 0: none.
  Injection(Countdown& countdown, long failing) : countdown_(countdown) {
    countdown.calls = 0;
    countdown.failing = failing;
    countdown.enabled = true;
  }
  Injection(const Injection&) = delete;
  Injection& operator=(const Injection&) = delete;
  ~Injection() { countdown_.enabled = false; }

 private:
  Countdown& countdown_;
};

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

void* operator new(std::size_t size) {
  return allocate(size, 0);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

// These replace those of the C library for our own code.
extern "C" ssize_t write(int file, const void* bytes, std::size_t size) {
  if (writes.fails()) {
    errno = ENOSPC;
    return -1;
  }
  return ::syscall(SYS_write, file, bytes, size);
}
extern "C" int fsync(int file) {
  if (writes.fails()) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_fsync, file));
}
extern "C" int rename(const char* from, const char* to) noexcept {
  if (writes.fails()) {
    errno = EACCES;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

namespace {

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

/// The first calls, and then fewer and fewer up to the last.
std::vector<long> chosenUpTo(long last) {
  std::vector<long> chosen;
  for (long n = 1; n <= last; n += 1 + n / 12) chosen.push_back(n);
  return chosen;
}

RenderJob jobIn(const fs::path& folder) {
  RenderJob job;
  job.scene = folder / "scene.xml";
  job.cacheFolder = folder / "lobes";
  const fs::path out = folder / "out";
  job.outputs = {out / "a.exr", out / "a.png"};
  job.saveIllumination = out / "a.illum";
  job.checkpoint = out / "run.ckpt";
  job.samples = 2;
  job.passes = 1;
  job.training.photons = 300;
  job.training.importons = 150;
  return job;
}

/// Checks that files in the folder are complete, and that there are no others.
void checkWhole(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    CAPTURE(name);
    if (name == "a.exr" || name == "a.png")
      CHECK(readImage(entry.path()).width == 16);
    else if (name == "a.illum")
      CHECK(IlluminationFile::open(entry.path()).bytes() > 0);
    else if (name == "run.ckpt")
      CHECK(CheckpointFile::open(entry.path()).pixels().size() == 16 * 12);
    else if (name.ends_with(".lobe"))
      CHECK(LobeCache::open(entry.path()).bytes() > 0);
    else
      CHECK(name == "no other file");
  }
}

/// Calls work with an empty output folder for chosen calls that fail, and checks what it leaves. Returns how many calls
/// failed and were reported.
int injectInto(Countdown& countdown, const fs::path& out, const std::function<void()>& work,
               const std::function<std::string()>& result) {
  const auto again = [&](long failing) {
    fs::remove_all(out);
    fs::create_directory(out);
    try {
      const Injection injection(countdown, failing);
      work();
      return true;
    } catch (const std::exception&) {
      return false;
    }
  };
  REQUIRE(again(0));
  const long calls = countdown.calls;
  const std::string expected = result();
  checkWhole(out);
  int reported = 0;
  for (const long n : chosenUpTo(calls)) {
    CAPTURE(n, calls);
    const bool succeeded = again(n);
    checkWhole(out);
    if (succeeded)
      CHECK(result() == expected);
    else
      ++reported;
  }
  REQUIRE(again(0));
  CHECK(result() == expected);
  return reported;
}

int injectIntoRender(Countdown& countdown, const SceneFolder& folder) {
  const RenderJob job = jobIn(folder.path());
  const StopFlag never = 0;
  return injectInto(
      countdown, folder / "out", [&] { run(job, never); },
      [&] { return readFile(folder / "out" / "a.exr") + readFile(folder / "out" / "a.illum"); });
}

int injectIntoCompile(Countdown& countdown, const SceneFolder& folder) {
  const std::vector<LobeUse> uses = collectLobes(readScene(folder / "scene.xml"));
  CompileOptions options;
  options.directory = folder / "out";
  options.elevations = 4;
  options.settings.samples = 64;
  const std::vector<CompileJob> jobs = planCompile(uses, options);
  return injectInto(
      countdown, folder / "out", [&] { runCompile(jobs.front(), {}); }, [&] { return readFile(jobs.front().path); });
}

}  // namespace

TEST_CASE("faults: whichever allocation of a render fails") {
  const SceneFolder folder(true);
  CHECK(injectIntoRender(allocations, folder) > 50);
}

TEST_CASE("faults: an allocation that fails while rendering does not lose the samples so far") {
  const SceneFolder folder(true);
  RenderJob job = jobIn(folder.path());
  job.integrator = IntegratorKind::path;
  job.saveIllumination.clear();
  job.samples = 64;
  const StopFlag never = 0;
  const fs::path picture = folder / "out" / "a.exr";
  fs::create_directory(folder / "out");
  {
    const Injection counted(allocations, 0);
    run(job, never);
  }
  const long calls = allocations.calls;
  int rescued = 0;
  for (long n = calls; n > 0; n -= 1 + calls / 60) {
    fs::remove(picture);
    try {
      const Injection injection(allocations, n);
      run(job, never);
    } catch (const std::exception&) {
      if (!fs::exists(picture)) continue;
      const ImageAttributes all = readAttributes(picture);
      rescued += all.contains("interrupted") || std::get<double>(all.at("samples")) < 64;
    }
  }
  checkWhole(folder / "out");
  CHECK(rescued > 0);
}

TEST_CASE("faults: whichever write of a render fails") {
  const SceneFolder folder(true);
  CHECK(injectIntoRender(writes, folder) > 5);
}

TEST_CASE("faults: whichever allocation of a compilation fails") {
  const SceneFolder folder(false);
  CHECK(injectIntoCompile(allocations, folder) > 50);
}

TEST_CASE("faults: whichever write of a compilation fails") {
  const SceneFolder folder(false);
  CHECK(injectIntoCompile(writes, folder) == 3);
}
