#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>

#include <sys/resource.h>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/task.h>
#include <CLI/CLI.hpp>

#include "fitter/compile.h"
#include "lobe/fitting.h"
#include "runtime/core/atomic_file.h"
#include "runtime/core/parallel.h"
#include "runtime/tools/cache_report.h"
#include "runtime/tools/tool.h"
#include "scenes/scene_lobes.h"
#include "tests/support/fitter_test_lobes.h"
#include "tests/support/json.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

namespace {

Scene sceneOf(const std::vector<std::pair<std::string, BsdfPtr>>& materials) {
  Scene scene;
  for (const auto& [name, bsdf] : materials) scene.materials.push_back({name, bsdf});
  return scene;
}

CompileOptions quickOptions(const fs::path& folder) {
  CompileOptions options;
  options.directory = folder / "caches";
  options.elevations = 6;
  options.directions = 12;
  options.settings.samples = 512;
  return options;
}

void runAll(const std::vector<CompileJob>& jobs) {
  for (const CompileJob& job : jobs)
    if (!job.upToDate) runCompile(job, [] {});
}

}  // namespace

TEST_CASE("fitter: equal lobes of different materials are fitted once") {
  const Scene scene = sceneOf({{"red", roughConductor(0.2, 0.2)},
                               {"rough", roughConductor(0.3, 0.3)},
                               {"blue", roughConductor(0.2, 0.2)},
                               {"plain", makeBsdf("diffuse", {})}});
  const std::vector<LobeUse> uses = collectLobes(scene);
  REQUIRE(uses.size() == 2);
  CHECK(uses[0].materials == std::vector<std::string>{"red", "blue"});
  CHECK(uses[1].materials == std::vector<std::string>{"rough"});
  CHECK(abbreviated(uses[0].materials) == "red + 1 more");
}

TEST_CASE("fitter: caches that are up to date are kept and stale ones give a reason") {
  const Folder folder;
  const std::vector<LobeUse> uses =
      collectLobes(sceneOf({{"iso", roughConductor(0.3, 0.3)}, {"aniso", roughConductor(0.1, 0.3)}}));
  CompileOptions options = quickOptions(folder.path());
  std::vector<CompileJob> jobs = planCompile(uses, options);
  REQUIRE(jobs.size() == 2);
  CHECK((jobs[0].grid.kind == GridKind::elevation && jobs[1].grid.kind == GridKind::fibonacci));
  CHECK((!jobs[0].upToDate && jobs[0].stale.empty()));
  runAll(jobs);
  for (const CompileJob& job : planCompile(uses, options)) CHECK(job.upToDate);

  options.force = true;
  CHECK(!planCompile(uses, options)[0].upToDate);
  options.force = false;
  options.settings.components = 4;
  CHECK(planCompile(uses, options)[0].stale == "different fit settings");
  options = quickOptions(folder.path());
  options.elevations = 7;
  jobs = planCompile(uses, options);
  CHECK(jobs[0].stale == "different grid of directions");
  CHECK(jobs[1].upToDate);
  fs::resize_file(jobs[1].path, 100);
  CHECK_THAT(planCompile(uses, options)[1].stale, Catch::Contains("truncated"));
}

TEST_CASE("fitter: caches of a newer format and those that cannot be read are kept") {
  const Folder folder;
  const std::vector<LobeUse> uses = collectLobes(sceneOf({{"iso", roughConductor(0.3, 0.3)}}));
  CompileOptions options = quickOptions(folder.path());
  const fs::path path = planCompile(uses, options)[0].path;
  runAll(planCompile(uses, options));
  const std::string sound = readFile(path);
  const auto checkKept = [&](const CompileJob& job, const std::string& fault) {
    CHECK((!job.upToDate && job.stale.empty()));
    CHECK_THAT(job.fault, Catch::StartsWith(path.string() + ": ") && Catch::Contains(fault));
    const std::string before = readFile(path);
    CHECK_THROWS_WITH(runCompile(job, [] {}), job.fault);
    CHECK(readFile(path) == before);
  };

#if !defined(LOBE_SANITIZED)  // the sanitizers need files themselves, for checks of virtual bases
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  const rlimit none{0, files.rlim_max};
  setrlimit(RLIMIT_NOFILE, &none);
  const CompileJob unreadable = planCompile(uses, options)[0];
  setrlimit(RLIMIT_NOFILE, &files);
  checkKept(unreadable, "cannot open");
#endif

  std::string newer = sound, older = sound;
  newer[8] = static_cast<char>(kLobeFormat.major + 1);
  older[8] = static_cast<char>(kLobeFormat.major - 1);
  writeAtomically(path, newer);
  checkKept(planCompile(uses, options)[0], "use a newer Lobe");
  options.force = true;
  const CompileJob forced = planCompile(uses, options)[0];
  CHECK((forced.stale == "--force" && forced.fault.empty()));
  runCompile(forced, [] {});
  CHECK(readFile(path) == sound);

  options.force = false;
  writeAtomically(path, older);
  const CompileJob again = planCompile(uses, options)[0];
  CHECK_THAT(again.stale, Catch::Contains("older"));
  runCompile(again, [] {});
  CHECK(readFile(path) == sound);
}

TEST_CASE("fitter: lobefit names a cache of a newer format and writes the others") {
  const Folder folder;
  writeAtomically(folder / "scene.xml", std::string(R"(<scene version="0.6.0">
    <shape type="sphere"><bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="sphere"><bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></shape></scene>)"));
  const std::string fit = "lobefit scene.xml --elevations 4 --samples 256";
  REQUIRE(runBinary(folder.path(), fit).code == 0);
  std::vector<fs::path> caches;
  for (const auto& entry : fs::directory_iterator(folder / "lobes")) caches.push_back(entry.path());
  REQUIRE(caches.size() == 2);
  std::string newer = readFile(caches[0]);
  const std::string other = readFile(caches[1]);
  newer[8] = static_cast<char>(kLobeFormat.major + 1);
  writeAtomically(caches[0], newer);
  fs::remove(caches[1]);
  const ToolRun r = runBinary(folder.path(), fit);
  CHECK(r.code == 1);
  CHECK_THAT(r.error, Catch::Contains("lobefit: error: lobes/" + caches[0].filename().string() + ": format version") &&
                          Catch::Contains("1 of 2 lobes written") && !Catch::Contains("fitted again"));
  CHECK((readFile(caches[0]) == newer && readFile(caches[1]) == other));
  CHECK(runBinary(folder.path(), fit + " --force").code == 0);
  CHECK(readFile(caches[0]) != newer);
}

TEST_CASE("fitter: near-mirrors get caches on fixed grids with each method") {
  const Folder folder;
  // Near-mirrors are narrowest at grazing angles, where their width is proportional to the cosine. Of nine directions,
  // the last one begins a chain, so no method starts from a neighbour there.
  struct Case {
    FitMethod method;
    double alpha;
    int elevations;
  };
  for (const auto& [method, alpha, elevations] :
       {Case{FitMethod::wem, 1e-3, 96}, Case{FitMethod::wem, 1e-4, 9}, Case{FitMethod::ceres, 1e-4, 9},
        Case{FitMethod::eq8, 1e-4, 9}, Case{FitMethod::automatic, 1e-4, 9}}) {
    CompileOptions options = quickOptions(folder.path());
    options.settings.method = method;
    options.settings.samples = 256;
    options.elevations = elevations;
    options.force = true;
    const Scene scene = sceneOf({{"mirror", roughConductor(alpha, alpha, "beckmann")}});
    const std::vector<CompileJob> jobs = planCompile(collectLobes(scene), options);
    runAll(jobs);
    CAPTURE(nameOf(method), alpha);
    const LobeCache cache = LobeCache::open(jobs.at(0).path);
    REQUIRE(cache.records().size() == static_cast<std::size_t>(elevations));
    CHECK(cache.records().front().count > 0);
    const CacheRecord& grazing = cache.records().back();
    CHECK((grazing.count == 0 && grazing.cosineMass == 0));
    CHECK((grazing.albedo > 0.3f && grazing.albedo < 1.001f));
  }
}

TEST_CASE("fitter: cache files do not depend on the number of threads") {
  const Folder folder;
  const LobeUse iso = collectLobes(sceneOf({{"iso", roughConductor(0.3, 0.3)}})).at(0),
                aniso = collectLobes(sceneOf({{"aniso", roughConductor(0.1, 0.3)}})).at(0);
  CompileOptions fixedGrid = quickOptions(folder.path()), adaptive = fixedGrid;
  adaptive.elevations = adaptive.directions = std::nullopt;
  adaptive.settings.quality = 0.3f;
  struct Case {
    std::vector<LobeUse> uses;
    CompileOptions options;
  };
  for (Case c : {Case{{iso, aniso}, fixedGrid}, Case{{aniso}, adaptive}}) {
    std::array<std::vector<std::string>, 2> contents;
    for (const std::size_t threads : {1u, 2u}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      c.options.directory = folder / std::to_string(threads);
      c.options.force = true;
      const std::vector<CompileJob> jobs = planCompile(c.uses, c.options);
      runAll(jobs);
      for (const CompileJob& job : jobs) contents[threads - 1].push_back(readFile(job.path));
    }
    CHECK(contents[0] == contents[1]);
    CHECK(contents[0].at(0).size() > 500);
  }
}

TEST_CASE("fitter: no file is written for a lobe whose sampler draws nothing") {
  const Folder folder;
  LobeFunctions lobe;
  lobe.model = "unsampled";
  lobe.key = "unsampled lobe";
  lobe.evaluate = [](const Float3&, const Float3&) { return 0.3; };
  lobe.sample = [](const Float3&, const Float2&) { return std::optional<LobeDirection>(); };
  lobe.pdf = [](const Float3&, const Float3&) { return 0.0f; };
  FittingOptions options;
  options.folder = folder / "caches";
  const auto grazing = [](const Float3& w) { return w.z < 0.5f ? 0.3 : 0.0; };
  const std::function<double(const Float3&, const Float3&)> reflectances[] = {
      lobe.evaluate,
      [&](const Float3& wo, const Float3& wi) { return grazing(wo) * grazing(wi); },  // like sheen, black from above
      [](const Float3& wo, const Float3& wi) { return wi.x == -wo.x && wi.y == -wo.y ? 1e9 : 0.0; }};  // a mirror
  for (const auto& reflectance : reflectances) {
    lobe.evaluate = reflectance;
    CHECK_THROWS_WITH(compileLobe(lobe, options), Catch::Contains("draws no direction"));
    CHECK(fs::is_empty(options.folder));
  }
  lobe.evaluate = [](const Float3&, const Float3&) { return 0.0; };  // black
  CHECK(compileLobe(lobe, options).fitted);
  CHECK(!compileLobe(lobe, options).fitted);
}

TEST_CASE("fitter: the summary of a cache agrees with its records") {
  const Folder folder;
  LobeCacheInfo info;
  info.model = info.key = info.summary = info.toolVersion = "x";
  info.gridCount = 3;
  const CacheComponent c{1, 0, 0, 0.1f, 0, 0.1f};
  const CacheComponent half{0.5f, 0, 0, 0.1f, 0, 0.1f};
  const std::vector<CacheRecord> records{{0, 0, 1, 1, 1, 0.5f, 0.1f, 0.3f, 0.4f, 2.0f},
                                         {1, 1, 2, 1, 1, 0.5f, 0.3f, 0.1f, 0.6f, 5.0f},
                                         {2, 0, 1, 1, 1, 0.5f, 0.2f, 0.2f, 0.5f, 3.0f}};
  writeAtomically(folder / "x.lobe",
                  encodeLobeCache(info, records, std::vector{c, half, half}, std::vector<std::uint32_t>{0, 1, 2}));
  const CacheSummary s = summarise(LobeCache::open(folder / "x.lobe"));
  CHECK(s.records == 3);
  CHECK(s.meanComponents == Approx(4.0 / 3));
  CHECK(s.nevMedian == Approx(0.2));
  CHECK(s.nevWorst == Approx(0.3));
  CHECK(s.coverageMedian == Approx(0.5));
  CHECK(s.coverageWorst == Approx(0.6));
  CHECK(s.worstRatio == Approx(5));
  CHECK(s.outside == Approx(0.2));
}

TEST_CASE("fitter: errors name the option that is out of range") {
  const auto fault = [](const std::function<void(CompileOptions&)>& change) {
    CompileOptions options;
    change(options);
    try {
      options.validate();
    } catch (const std::runtime_error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  CHECK(fault([](CompileOptions&) {}).empty());
  CHECK_THAT(fault([](CompileOptions& o) { o.settings.components = 0; }), Catch::Contains("--components"));
  CHECK_THAT(fault([](CompileOptions& o) { o.settings.components = 33; }), Catch::Contains("--components"));
  CHECK_THAT(fault([](CompileOptions& o) { o.settings.samples = 3; }), Catch::Contains("--samples"));
  CHECK_THAT(fault([](CompileOptions& o) { o.settings.reduction = -1; }), Catch::Contains("--reduction"));
  CHECK_THAT(fault([](CompileOptions& o) { o.settings.reduction = std::nanf(""); }), Catch::Contains("--reduction"));
  CHECK_THAT(fault([](CompileOptions& o) { o.elevations = 0; }), Catch::Contains("--elevations"));
  CHECK_THAT(fault([](CompileOptions& o) { o.directions = -5; }), Catch::Contains("--directions"));
  CHECK_THAT(fault([](CompileOptions& o) { o.directory = ""; }), Catch::Contains("--output"));
}

namespace {

const char* const kTwoMaterials = R"(<scene version="0.6.0">
  <bsdf type="roughconductor" id="Steel"><string name="distribution" value="ggx"/>
    <float name="alpha" value="$roughness"/></bsdf>
  <bsdf type="roughconductor" id="Again"><string name="distribution" value="ggx"/>
    <float name="alpha" value="0.3"/></bsdf>
  <shape type="sphere"><ref id="Steel"/></shape>
  <shape type="sphere"><ref id="Again"/></shape>
  <shape type="sphere"><bsdf type="diffuse"/></shape>
</scene>)";

}  // namespace

TEST_CASE("fitter: lobefit compiles a scene once and lobedump shows the caches") {
  const Folder folder;
  writeAtomically(folder / "scene.xml", std::string(kTwoMaterials));
  const std::string fit = "lobefit scene.xml -D roughness=0.3 --elevations 4 --samples 256";
  ToolRun r = runBinary(folder.path(), fit + " --json");
  CHECK(r.code == 0);
  CHECK_THAT(r.error, Catch::Contains("1 of 1 lobes written to lobes"));
  const auto json = parseJson(r.out);
  REQUIRE(json.size() == 1);
  CHECK(json[0]["materials"] == nlohmann::json({"Steel", "Again"}));
  CHECK(json[0]["records"] == 4);
  r = runBinary(folder.path(), fit);
  CHECK(r.code == 0);
  CHECK_THAT(r.error, Catch::Contains("nothing to do"));
  CHECK_THAT(r.out, Catch::Contains("Steel + 1 more") && Catch::Contains("up to date"));

  r = runBinary(folder.path(), "lobedump lobes/*.lobe --records");
  CHECK(r.code == 0);
  CHECK(lineCount(r.out) == 6 + 5 + 1 + 2);  // header, records, gap, table
  r = runBinary(folder.path(), "lobedump --json lobes/*.lobe");
  CHECK(parseJson(r.out)[0]["records"].size() == 4);
}

TEST_CASE("fitter: if one lobe fails the caches of the others are complete") {
  const Folder folder;
  std::string scene = "<scene version=\"3.0.0\">";
  for (int i = 0; i < 6; ++i)
    scene += fmt::format(R"(<shape type="sphere"><bsdf type="roughconductor"><string name="distribution" value="ggx"/>
                            <float name="alpha" value="{}"/></bsdf></shape>)",
                         0.1 + 0.05 * i);
  writeAtomically(folder / "scene.xml", scene + "</scene>");
  const std::string fit = "lobefit scene.xml --method wem --elevations 24 --samples 512 -o ";
  REQUIRE(runBinary(folder.path(), fit + "clean").code == 0);
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(folder / "clean")) names.push_back(entry.path().filename());
  REQUIRE(names.size() == 6);
  // Folders take the place of two cache files, so their lobes fail while the others are being fitted.
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::array obstacles{names[i], names[(i + 1) % names.size()]};
    fs::remove_all(folder / "b");
    for (const fs::path& obstacle : obstacles) fs::create_directories(folder / "b" / obstacle);
    const ToolRun r = runBinary(folder.path(), fit + "b --json");
    CHECK(r.code == 1);
    CHECK_THAT(r.error, Catch::Contains("4 of 6 lobes written to b"));
    CHECK(parseJson(r.out).size() == 4);
    for (const fs::path& obstacle : obstacles) {
      CHECK_THAT(r.error, Catch::Contains("lobefit: error: b/" + obstacle.string() + ": cannot write: is a directory"));
      CHECK(r.out.find(obstacle.string()) == std::string::npos);
      fs::remove(folder / "b" / obstacle);
    }
    CHECK(runBinary(folder.path(), fit + "b").code == 0);
    for (const fs::path& name : names) CHECK(readFile(folder / "b" / name) == readFile(folder / "clean" / name));
  }
}

TEST_CASE("fitter: a folder that cannot be created is one error") {
  const Folder folder;
  writeAtomically(folder / "scene.xml", std::string(kTwoMaterials));
  writeAtomically(folder / "file", std::string("no folder"));
  const ToolRun r =
      runBinary(folder.path(), "lobefit scene.xml -D roughness=0.2 --elevations 4 --samples 256 -o file/lobes");
  CHECK(r.code == 1);
  CHECK_THAT(r.error, Catch::Contains("file/lobes: cannot create folder"));
  CHECK(lineCount(r.error) == 1);
  CHECK(r.out.empty());
}

TEST_CASE("fitter: no cache replaces a file that is read") {
  const Folder folder;
  writeAtomically(folder / "scene.xml", std::string(kTwoMaterials));
  const std::string fit = "lobefit scene.xml -D roughness=0.2 --elevations 4 --samples 256";
  REQUIRE(runBinary(folder.path(), fit).code == 0);
  std::vector<fs::path> caches;
  for (const auto& entry : fs::directory_iterator(folder / "lobes")) caches.push_back(entry.path());
  REQUIRE(caches.size() == 2);
  const std::string scene = readFile(folder / "scene.xml"), cache = readFile(caches[1]);
  const auto checkRefused = [&] {
    const ToolRun r = runBinary(folder.path(), fit);
    CHECK(r.code == 2);
    CHECK_THAT(r.error, Catch::Contains(caches[0].filename().string() + ": is both an input and an output"));
    CHECK(readFile(folder / "scene.xml") == scene);
    CHECK(readFile(caches[1]) == cache);
    fs::remove(caches[0]);
  };
  fs::remove(caches[0]);
  fs::create_symlink("../scene.xml", caches[0]);
  checkRefused();
  fs::create_hard_link(folder / "scene.xml", caches[0]);
  checkRefused();
  fs::create_symlink(caches[1].filename(), caches[0]);
  checkRefused();
}

TEST_CASE("fitter: a fit that is cancelled from outside throws instead of returning a partial result") {
  const BsdfPtr bsdf = roughConductor(0.3, 0.3);
  CompileOptions options;
  const CompileJob job = planCompile(collectLobes(sceneOf({{"a", bsdf}})), options).front();
  for (const bool fixedGrid : {true, false}) {
    FitSettings settings = job.info.settings;
    settings.fixedGrid = fixedGrid;
    bool returned = false;
    const auto fitBesideFailure = [&] {
      parallelFor(0, 1, [&](int) {
        // Cancel the enclosing loop at the first fitted direction.
        tbb::task_group_context* enclosing = tbb::task::current_context();
        fitGrid(*job.use.lobe, job.grid, settings, [enclosing] { enclosing->cancel_group_execution(); });
        returned = true;
      });
    };
    CHECK_THROWS_AS(fitBesideFailure(), LoopCancelled);
    CHECK(!returned);
  }
}

TEST_CASE("fitter: tools report invalid input in one line") {
  const Folder folder;
  writeAtomically(folder / "scene.xml", std::string(kTwoMaterials));
  writeAtomically(folder / "broken.xml", std::string("<scene><bsdf type='diffuse'></scene>"));
  writeAtomically(folder / "no.lobe", std::string("something else"));
  writeAtomically(folder / "empty.lobe", std::string());
  const std::pair<const char*, int> cases[] = {{"lobefit", 2},
                                               {"lobefit scene.xml --components 0 -D roughness=1", 2},
                                               {"lobefit scene.xml --samples many", 2},
                                               {"lobefit scene.xml --threads 0", 2},
                                               {"lobefit scene.xml -D roughness", 2},
                                               {"lobefit scene.xml --plot", 2},
                                               {"lobefit scene.xml -D roughness=1 --reduction 0.1", 2},
                                               {"lobefit scene.xml -D roughness=1 --method wem --quality 0.1", 2},
                                               {"lobefit scene.xml", 1},  // $roughness is not defined
                                               {"lobefit missing.xml", 1},
                                               {"lobefit broken.xml", 1},
                                               {"lobefit scene.xml -D roughness=0.3 -o scene.xml/x", 1},
                                               {"lobedump", 2},
                                               {"lobedump missing.lobe", 1},
                                               {"lobedump no.lobe", 1},
                                               {"lobedump empty.lobe", 1},
                                               {"lobedump .", 1}};
  for (const auto& [arguments, code] : cases) {
    const ToolRun r = runBinary(folder.path(), arguments);
    CAPTURE(arguments, r.error);
    CHECK(r.code == code);
    CHECK(lineCount(r.error) == 1);
    CHECK_THAT(r.error, Catch::Contains(": error: "));
    CHECK(r.out.empty());
  }
  CHECK(!fs::exists(folder / "lobes"));
}

TEST_CASE("fitter: tools return the documented exit codes") {
  const auto run = [](std::vector<std::string> arguments, const std::function<void()>& work) {
    std::vector<char*> argv;
    argv.reserve(arguments.size());
    for (std::string& a : arguments) argv.push_back(a.data());
    int number = 0;
    return runTool(
        "tool", "A tool.", static_cast<int>(argv.size()), argv.data(),
        [&](CLI::App& app) { app.add_option("--number", number, "A number"); }, work);
  };
  const auto nothing = [] {};
  CHECK(run({"tool"}, nothing) == 0);
  CHECK(run({"tool", "--number", "3"}, nothing) == 0);
  CHECK(run({"tool", "--number", "x"}, nothing) == 2);
  CHECK(run({"tool", "--unknown"}, nothing) == 2);
  CHECK(run({"tool"}, [] { throw UsageError("no"); }) == 2);
  CHECK(run({"tool"}, [] { throw std::runtime_error("failed"); }) == 1);
}
