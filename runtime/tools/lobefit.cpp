// lobefit SCENE.xml [-o DIR]: compiles the glossy lobes of a scene's materials into cache files.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "fitter/compile.h"
#include "runtime/core/parallel.h"
#include "runtime/core/stop.h"
#include "runtime/tools/cache_report.h"
#include "runtime/tools/check_report.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/tool.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_lobes.h"

namespace {

using namespace lobe;

struct Options {
  std::string scene;
  CompileOptions compile;
  ReadOptions read;
  std::string method = nameOf(FitMethod::automatic);
  std::optional<float> quality, reduction;  // empty if not given
  int threads = 0;
  bool check = false;
  bool json = false;
};

void declare(CLI::App& app, Options& o) {
  app.add_option("scene", o.scene, "Mitsuba scene file")->required()->type_name("SCENE.xml")->default_str("");
  app.add_option("-o,--output", o.compile.directory, "Folder of the cache files, created if missing")->type_name("DIR");
  app.add_option("--method", o.method,
                 "Fitting method: auto (the cheapest that reaches --quality), wem (weighted EM), ceres (least squares "
                 "for product sampling) or eq8 (least squares on Eq. 8 of Herholz et al. 2016)");
  app.add_option("--components", o.compile.settings.components,
                 "Number of Gaussians per record (with --method auto: the maximum)");
  app.add_option("--quality", o.quality,
                 "Target relative variance (NEV) of product sampling with a record (only --method auto)")
      ->default_str(fmt::format("{:g}", o.compile.settings.quality));
  app.add_option("--elevations", o.compile.elevations,
                 fmt::format("Fixed number of records per isotropic lobe (default: {}; with --method auto, as many as "
                             "the quality requires)",
                             kElevations));
  app.add_option(
      "--directions", o.compile.directions,
      fmt::format("Fixed number of records per anisotropic lobe (default: {}; with --method auto, as many as "
                  "the quality requires)",
                  kDirections));
  app.add_option("--samples", o.compile.settings.samples, "Number of samples drawn to fit a record");
  app.add_option("--reduction", o.reduction,
                 "Merge Gaussians of a record up to this cost (Runnalls 2007; 0: no merging; not with --method auto)")
      ->default_str(fmt::format("{:g}", o.compile.settings.reduction));
  app.add_flag("--force", o.compile.force,
               "Fit all lobes again, even if their caches are up to date or have a newer format");
  app.add_flag("--lenient", o.read.lenient, "Replace or leave out faulty parts of the scene, with warnings");
  app.add_flag("--check", o.check,
               "Only read the materials and print all faults, warnings and notes; exit with 1 if they cannot be read");
  app.add_flag("--json", o.json, "Print the table of caches, or the result of --check, as JSON");
  app.add_option("--camera", o.read.camera,
                 "Scene file whose sensor will be used: -D may define names of this file, too")
      ->type_name("FILE.xml");
  addThreads(app, o.threads);
  addDefinitions(app, o.read.definitions);
}

/// Options that have no effect with the chosen method are errors, too.
void takeMethod(Options& o) {
  const std::optional<FitMethod> method = fitMethodOf(o.method);
  if (!method)
    throw UsageError(fmt::format("--method must be one of {}, not '{}'", fmt::join(kFitMethodNames, ", "), o.method));
  o.compile.settings.method = *method;
  const bool isAuto = o.compile.settings.method == FitMethod::automatic;
  if (o.reduction && isAuto)
    throw UsageError("--reduction cannot be combined with --method auto, which chooses the number of Gaussians itself");
  if (o.quality && !isAuto)
    throw UsageError("--quality requires --method auto; the other methods do not choose by quality");
  if (o.reduction) o.compile.settings.reduction = *o.reduction;
  if (o.quality) o.compile.settings.quality = *o.quality;
}

void validate(const Options& o) {
  try {
    o.compile.validate();
  } catch (const std::runtime_error& e) {
    throw UsageError(e.what());
  }
}

double secondsToRun(const CompileJob& job, Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  runCompile(job, [&progress] { progress.advance(); });
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Error messages about a file begin with its path.
std::string withoutPath(const std::string& fault, const std::filesystem::path& path) {
  const std::string start = path.string() + ": ";
  return fault.starts_with(start) ? fault.substr(start.size()) : fault;
}

CacheReport compileOne(const CompileJob& job, Progress& progress) {
  const double seconds = job.upToDate ? 0 : secondsToRun(job, progress);
  const LobeCache cache = LobeCache::open(job.path);
  return {job.path, job.info.summary, job.use.materials, summarise(cache), job.upToDate, seconds};
}

/// Throws UsageError if a cache would replace a file that is read: of the scene, or another cache.
void checkCaches(const std::vector<CompileJob>& jobs, const Scene& scene, const Options& o) {
  std::vector<std::filesystem::path> written, read = scene.files;
  read.emplace_back(o.scene);
  read.push_back(o.read.camera);
  for (const CompileJob& job : jobs) (job.upToDate ? read : written).push_back(job.path);
  checkOutputs(written, read);
}

double workOfAll(const std::vector<CompileJob>& jobs) {
  double directions = 0;
  for (const CompileJob& job : jobs)
    if (!job.upToDate && job.fault.empty()) directions += workOf(job);
  return directions;
}

void printStale(const std::vector<CompileJob>& jobs) {
  for (const CompileJob& job : jobs)
    if (!job.stale.empty())
      printDiagnostic(
          fmt::format("lobefit: {} is fitted again: {}\n", job.path.string(), withoutPath(job.stale, job.path)));
}

/// The caches of all jobs.
struct Outcomes {
  std::vector<CacheReport> reports;
  std::vector<std::exception_ptr> failures;  ///< why there is no cache; null if there is one
};

Outcomes compileAll(const std::vector<CompileJob>& jobs, const StopFlag& stop) {
  Progress progress("fitting", workOfAll(jobs));
  Outcomes outcomes{std::vector<CacheReport>(jobs.size()), {}};
  // Lobes are fitted in parallel as well, because the first few directions of each lobe leave cores idle.
  std::atomic<std::size_t> complete = static_cast<std::size_t>(std::ranges::count_if(jobs, &CompileJob::upToDate));
  try {
    stoppable(stop, "", [&] {
      outcomes.failures = parallelAttempts(jobs.size(), [&](std::size_t i) {
        outcomes.reports[i] = compileOne(jobs[i], progress);
        if (!jobs[i].upToDate) ++complete;
      });
    });
  } catch (const Stopped&) {
    throw Stopped(
        fmt::format("{} of {} caches are complete; the same command fits the others", complete.load(), jobs.size()));
  }
  return outcomes;
}

/// The caches that are complete. The errors of the others are added to the errors.
std::vector<CacheReport> completeOnes(const std::vector<CompileJob>& jobs, const Outcomes& outcomes,
                                      OutputErrors& errors) {
  std::vector<CacheReport> reports;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    if (outcomes.failures[i])
      errors.attempt(jobs[i].path, [&] { std::rethrow_exception(outcomes.failures[i]); });
    else
      reports.push_back(outcomes.reports[i]);
  }
  return reports;
}

void printResult(const std::vector<CacheReport>& reports, const Options& o) {
  if (o.json) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const CacheReport& r : reports) json.push_back(toJson(r));
    fmt::print("{}\n", jsonText(json));
    return;
  }
  if (!reports.empty()) printReports(reports, true, stdout);
}

/// lobes: the number of all, also of those whose caches could not be written. If these are all, the errors say it.
void reportSummary(const std::vector<CacheReport>& reports, std::size_t lobes, const Options& o) {
  if (reports.empty() && lobes > 0) return;
  const auto fresh = std::ranges::count_if(reports, [](const CacheReport& r) { return !r.upToDate; });
  const std::string folder = o.compile.directory.string();
  std::string line = fmt::format("{} of {} lobes written to {}", fresh, lobes, folder);
  if (lobes == 0)
    line = fmt::format("nothing to do: no material of {} has a glossy lobe to fit", o.scene);
  else if (fresh == 0 && reports.size() == lobes)
    line = fmt::format("nothing to do: all {} lobes in {} are up to date", lobes, folder);
  printDiagnostic(fmt::format("lobefit: {}\n", line));
}

/// Tells the user which lobes miss the quality target.
void reportMissedQuality(const std::vector<CacheReport>& reports, const Options& o) {
  if (o.compile.settings.method != FitMethod::automatic) return;
  const float quality = o.compile.settings.quality;
  const auto worstNev = [](const CacheReport& r) { return std::max(r.summary.nevWorst, r.summary.coverageWorst); };
  const auto missing = std::ranges::count_if(reports, [&](const CacheReport& r) { return worstNev(r) > quality; });
  if (missing == 0) return;
  const CacheReport& worst = *std::ranges::max_element(reports, {}, worstNev);
  printNote("lobefit",
            fmt::format("{} of {} lobes have records that miss --quality {:g}; the worst NEV is {:.3f}, of {}", missing,
                        reports.size(), quality, worstNev(worst), worst.lobe));
}

void run(Options& o) {
  takeMethod(o);
  validate(o);
  std::optional<tbb::global_control> limit;
  if (o.threads > 0) limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(o.threads));
  o.read.geometry = false;
  if (o.check) return reportCheck(o.scene, o.read, o.json, stdout);
  const StopFlag& stop = stopOnSignals();
  Scene scene;
  stoppable(stop, "while the scene was read, so no cache is written", [&] { scene = readScene(o.scene, o.read); });
  for (const std::string& note : scene.notes) printNote("lobefit", note);
  for (const std::string& warning : scene.warnings) printWarning("lobefit", warning);
  const std::vector<CompileJob> jobs = planCompile(collectLobes(scene), o.compile);
  checkCaches(jobs, scene, o);
  printStale(jobs);
  OutputErrors errors;
  const std::vector<CacheReport> reports = completeOnes(jobs, compileAll(jobs, stop), errors);
  reportSummary(reports, jobs.size(), o);
  reportMissedQuality(reports, o);
  printResult(reports, o);
  errors.throwIfAny();
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return lobe::runTool(
      "lobefit", "Compiles the glossy lobes of a scene's materials into caches of Gaussian mixtures.", argc, argv,
      [&](CLI::App& app) { declare(app, options); }, [&] { run(options); });
}
