// Fault injection: if an allocation, task, write or read fails while a cache is compiled or while a tiny scene is read,
// trained, rendered and written, the failure is reported as an exception, nothing is half-written, and a run that
// reports success has the same bytes as one without faults.

#include <atomic>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include <catch2/catch.hpp>

#include "fitter/compile.h"
#include "runtime/core/atomic_file.h"
#include "runtime/core/parallel.h"
#include "runtime/core/stop.h"
#include "runtime/image/aov.h"
#include "runtime/image/image.h"
#include "runtime/image/image_output.h"
#include "runtime/tools/render_run.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_lobes.h"
#include "tests/faults/injection.h"
#include "tests/support/loberender_test_tools.h"

namespace {

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

RenderJob jobIn(const fs::path& folder) {
  RenderJob job;
  job.scene = folder / "scene.xml";
  job.cacheFolder = folder / "lobes";
  const fs::path out = folder / "out";
  job.outputs = {out / "a.exr", out / "a.png"};
  job.saveIllumination = out / "a.illum";
  job.checkpoint = out / "run.ckpt";
  job.samples = kSamples;
  job.passes = 1;
  job.training.photons = 300;
  job.training.importons = 150;
  return job;
}

bool equal(const Image& a, const Image& b) {
  return std::ranges::equal(a.pixels, b.pixels, [](const Rgb& x, const Rgb& y) { return (x == y).all(); });
}

/// What a kind of render changes in the job of quickJobIn.
struct Render {
  const char* name;
  IntegratorKind integrator = IntegratorKind::product;
  bool hasIllumination = true, hasCheckpoint = true;  ///< whether the job saves them
  BdptGuide guide = BdptGuide::none;
  std::optional<ReconstructionNorm> gradients = std::nullopt;
  std::set<Aov> aovs = {};
};

const std::vector<Render> kRenders{
    {.name = "product"},
    {.name = "guided", .integrator = IntegratorKind::guided},
    {.name = "bdpt", .integrator = IntegratorKind::bdpt, .hasIllumination = false},
    {.name = "guided bdpt", .integrator = IntegratorKind::bdpt, .guide = BdptGuide::illumination},
    {.name = "vcm", .integrator = IntegratorKind::vcm, .hasIllumination = false},
    {.name = "gradients", .hasCheckpoint = false, .gradients = ReconstructionNorm::l2},
    {.name = "gradients of bdpt",
     .integrator = IntegratorKind::bdpt,
     .hasIllumination = false,
     .hasCheckpoint = false,
     .gradients = ReconstructionNorm::l1},
    {.name = "AOVs",
     .integrator = IntegratorKind::path,
     .hasIllumination = false,
     .aovs = {Aov::albedo, Aov::normal, Aov::depth, Aov::variance, Aov::samples}},
};

int injectInto(Countdown& countdown, const std::string& name, const RenderJob& job) {
  const StopFlag never = 0;
  return inject(countdown, {name, job.outputs.front().parent_path(), [&] { run(job, never); }});
}

/// A job without the parts that take long, which the default, auto, has.
RenderJob quickJobIn(const fs::path& folder) {
  RenderJob job = jobIn(folder);
  job.integrator = IntegratorKind::product;
  job.russianRoulette = RussianRoulette::throughput;
  job.lightPaths = LightPathUse::off;
  return job;
}

RenderJob quickJobIn(const fs::path& folder, const Render& render) {
  RenderJob job = quickJobIn(folder);
  job.integrator = render.integrator;
  job.guide = render.guide;
  job.gradients = render.gradients;
  job.aovs = render.aovs;
  if (!render.hasIllumination) job.saveIllumination.clear();
  if (!render.hasCheckpoint) job.checkpoint.clear();
  return job;
}

int injectIntoResumed(Countdown& countdown, const fs::path& folder) {
  RenderJob first = quickJobIn(folder);
  first.samples = 1;
  first.outputs = {folder / "first.exr"};
  first.saveIllumination.clear();
  first.checkpoint = folder / "start.ckpt";
  const StopFlag never = 0;
  run(first, never);
  RenderJob rest = quickJobIn(folder);
  rest.resume = first.checkpoint;
  return injectInto(countdown, "resume", rest);
}

int injectIntoAuto(Countdown& countdown) {
  const SceneFolder folder(true);
  return injectInto(countdown, "auto", jobIn(folder.path()));
}

void injectIntoAll(Countdown& countdown) {
  const SceneFolder folder(true);
  for (const Render& render : kRenders)
    CHECK(injectInto(countdown, render.name, quickJobIn(folder.path(), render)) > 0);
  CHECK(injectIntoResumed(countdown, folder.path()) > 0);
}

int injectIntoCompile(Countdown& countdown, const SceneFolder& folder) {
  const std::vector<LobeUse> uses = collectLobes(readScene(folder / "scene.xml"));
  CompileOptions options;
  options.directory = folder / "out";
  options.elevations = 4;
  options.settings.samples = 64;
  const std::vector<CompileJob> jobs = planCompile(uses, options);
  return inject(countdown, {"compile", folder / "out", [&] { runCompile(jobs.front(), {}); }});
}

}  // namespace

TEST_CASE("faults: failing allocations of a render") {
  CHECK(injectIntoAuto(allocations) > 50);
}

TEST_CASE("faults: failing tasks of a render") {
  CHECK(injectIntoAuto(tasks) > 10);
}

TEST_CASE("faults: an allocation that fails while rendering does not lose the samples so far") {
  const SceneFolder folder(true);
  RenderJob job = jobIn(folder.path());
  job.integrator = IntegratorKind::path;
  job.saveIllumination.clear();
  job.aovs = {Aov::albedo};
  job.samples = 64;
  const StopFlag never = 0;
  const fs::path picture = folder / "out" / "a.exr";
  fs::create_directory(folder / "out");
  std::map<int, Image> albedos;
  const auto albedoOf = [&](int samples) -> const Image& {
    const auto [found, isNew] = albedos.try_emplace(samples);
    if (isNew) {
      RenderJob whole = job;
      whole.outputs = {folder / "whole.exr"};
      whole.samples = samples;
      run(whole, never);
      found->second = readAovs(folder / "whole.exr").at(Aov::albedo);
    }
    return found->second;
  };
  {
    const Injection counted(allocations, 0);
    run(job, never);
  }
  const long calls = allocations.calls;
  int rescued = 0;
  for (long n = calls; n > 0; n -= 1 + calls / 150) {
    fs::remove(picture);
    try {
      const Injection injection(allocations, n);
      run(job, never);
    } catch (const std::exception&) {
      if (!fs::exists(picture)) continue;
      CAPTURE(n, calls);
      CHECK(readImage(picture).width == 16);
      const ImageAttributes all = readAttributes(picture);
      rescued += all.contains("interrupted") || std::get<double>(all.at("samples")) < 64;
      if (!all.contains("samples")) continue;
      // The features are those of the samples of the picture.
      const int samples = static_cast<int>(std::get<double>(all.at("samples")));
      const Aovs aovs = readAovs(picture);
      if (aovs.contains(Aov::albedo)) CHECK(equal(aovs.at(Aov::albedo), albedoOf(samples)));
    }
  }
  CHECK(rescued > 0);
}

TEST_CASE("faults: failing writes and reads of a render") {
  CHECK(injectIntoAuto(writes) > 5);
  CHECK(injectIntoAuto(reads) > 0);
}

TEST_CASE("faults: failing writes and reads of renders of any kind") {
  for (Countdown* countdown : {&writes, &reads}) injectIntoAll(*countdown);
}

TEST_CASE("faults: failing allocations of renders of any kind") {
  injectIntoAll(allocations);
}

TEST_CASE("faults: failing tasks of renders of any kind") {
  injectIntoAll(tasks);
}

TEST_CASE("faults: failing allocations and tasks of a compilation") {
  const SceneFolder folder(false);
  CHECK(injectIntoCompile(allocations, folder) > 50);
  CHECK(injectIntoCompile(tasks, folder) > 0);
}

TEST_CASE("faults: failing allocations and tasks of work that can be stopped") {
  const Folder folder;
  const StopFlag never = 0;
  std::atomic<int> done = 0;
  const auto work = [&] {
    done = 0;
    stoppable(never, "stopped", [&] { parallelFor(0, 100, [&](int) { ++done; }); });
  };
  for (Countdown* countdown : {&allocations, &tasks})
    CHECK(inject(*countdown, {"stoppable work", folder / "out", work, [&] { return std::to_string(done); }}) > 0);
}

TEST_CASE("faults: failing writes of a compilation") {
  const SceneFolder folder(false);
  // Opening, twice because it is tried before the fit, writing, synchronising, closing and renaming.
  CHECK(injectIntoCompile(writes, folder) == 6);
}

TEST_CASE("faults: a file whose permissions cannot be kept is replaced unless the new one would grant more") {
  const Folder folder;
  const fs::path path = folder.write("a", "before");
  const auto write = [&](const std::string& text, fs::perms permissions) {
    fs::permissions(path, permissions);
    constexpr long kChangeOfPermissions = 2;  // after opening the temporary file
    const Injection injection(writes, kChangeOfPermissions);
    writeAtomically(path, text);
  };
  CHECK_THROWS_WITH(write("refused", fs::perms::owner_read), path.string() + ": cannot write: Operation not permitted");
  CHECK(test::readFile(path) == "before");
  write("replaced", fs::perms::all);
  CHECK(test::readFile(path) == "replaced");
  CHECK(folder.files() == 1);
  {
    const Injection counted(writes, 0);
    writeAtomically(path, std::string("again"));  // has the permissions of a new file already
  }
  CHECK(writes.calls.load() == 5);  // opening, writing, synchronising, closing and renaming
  CHECK(test::readFile(path) == "again");
}
