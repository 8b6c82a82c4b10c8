#include "runtime/tools/render_job.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/resource.h>

#include <nlohmann/json.hpp>

#include "runtime/analysis/record_view.h"
#include "runtime/core/atomic_file.h"
#include "runtime/core/stopwatch.h"
#include "runtime/image/error_metrics.h"
#include "runtime/image/image_output.h"
#include "runtime/render/integrators/learn_sample_counts.h"
#include "runtime/render/integrators/path_integrator.h"
#include "runtime/render/integrators/pilot.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/light_learning.h"
#include "runtime/tools/stored_illumination.h"
#include "runtime/tools/tool.h"
#include "scenes/camera.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_hash.h"

namespace lobe {
namespace {

constexpr const char* kTool = "loberender";
// Fraction of --seconds. In the kitchen at 60 seconds, samples have the same variance after 11 seconds of training as
// after 21 seconds.
constexpr double kTrainingFraction = 0.15;
constexpr std::int64_t kMaxPixels = 1 << 28;  // larger sizes are assumed to be typing errors

const char* nameOf(IntegratorKind kind) {
  constexpr std::array names{"auto", "path", "guided", "product"};
  return names[static_cast<std::size_t>(kind)];
}

/// Quotes the word for the shell if necessary.
std::string quoted(const std::string& word) {
  const auto safe = [](unsigned char c) { return std::isalnum(c) || c >= 0x80 || std::strchr("/._-=+,:@%", c); };
  if (!word.empty() && std::ranges::all_of(word, safe)) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? "'\\''" : std::string(1, c);
  return text + "'";
}

/// The canonical absolute path, for comparing paths.
std::filesystem::path placeOf(const std::filesystem::path& path) {
  return std::filesystem::weakly_canonical(std::filesystem::absolute(path));
}

/// Checks before the work starts that all output files can be written and are distinct from each other and from the
/// inputs.
void checkFiles(const RenderJob& job) {
  std::vector<std::filesystem::path> written = job.outputs;
  for (const auto& path : {job.convergence, job.stats, job.saveIllumination})
    if (!path.empty()) written.push_back(path);
  if (job.record) written.push_back(job.recordImage);
  std::map<std::filesystem::path, int> uses;
  for (const auto& path : {job.scene, job.reference, job.illumination})
    if (!path.empty()) ++uses[placeOf(path)];
  for (const auto& path : written)
    if (++uses[placeOf(path)] > 1)
      throw UsageError(fmt::format("{}: is used for more than one file, and would be overwritten", path.string()));
  for (const auto& path : written) checkWritable(path);
}

double peakResidentBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

Scene readFor(const RenderJob& job) {
  Progress progress("reading", 1.0);
  Scene scene =
      readScene(job.scene, {job.definitions, job.lenient, true, [&](double fraction) { progress.advance(fraction); }});
  for (const std::string& note : scene.notes) printNote(kTool, note);
  for (const std::string& warning : scene.warnings) printWarning(kTool, warning);
  const bool shines = std::ranges::any_of(scene.shapes, [](const Shape& shape) { return shape.emitter.has_value(); });
  if (!shines && !scene.environment && scene.lights.empty())
    printWarning(kTool, fmt::format("{}: the scene has no light sources, so the picture is black", job.scene.string()));
  if (job.size) {
    if (scene.camera.crop)
      printWarning(kTool, "--size sets the size of the whole film; the crop window in the scene file is ignored");
    scene.camera.crop.reset();
    scene.camera.width = job.size->first;
    scene.camera.height = job.size->second;
    scene.camera.horizontalFov = horizontalFov(scene.camera, scene.camera.width, scene.camera.height);
  }
  return scene;
}

/// Records the error against time, one line for each call of add.
class ConvergenceLog {
 public:
  explicit ConvergenceLog(const RenderJob& job, const Scene& scene) : file_(job.convergence) {
    if (job.reference.empty()) return;
    reference_ = readImage(job.reference);
    const FilmCrop picture = scene.camera.picture();
    if (reference_->width != picture.width || reference_->height != picture.height)
      throw std::runtime_error(fmt::format("{}: the reference has {}x{} pixels, the picture {}x{}; use --size {}x{}",
                                           job.reference.string(), reference_->width, reference_->height, picture.width,
                                           picture.height, reference_->width, reference_->height));
  }

  void add(const Film& film, double seconds, int samples) {
    if (!reference_) return;
    const ErrorMetrics e = compareImages(*reference_, film.mean());
    text_ += fmt::format("{:.3f},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", seconds, samples, e.mse, e.relmse,
                         e.relmseDrop01, e.relmseDrop1, e.meanRatio);
  }

  void write() const {
    if (reference_)
      writeAtomically(file_, "seconds,spp,mse,relmse,relmse_drop_0.1pct,relmse_drop_1pct,mean_ratio\n" + text_);
  }

 private:
  std::filesystem::path file_;
  std::optional<Image> reference_;
  std::string text_;
};

/// The comparison of path and product for IntegratorKind::automatic.
struct Pilot {
  PilotResult path, product;
  double seconds;

  IntegratorKind best() const {
    return path.inefficiency() < product.inefficiency() ? IntegratorKind::path : IntegratorKind::product;
  }
};

/// BRDF caches and trained illumination; both are empty for `path`. Cannot be moved, because the sampler refers to the
/// other members.
struct Guiding {
  Guiding() = default;
  Guiding(const Guiding&) = delete;
  Guiding& operator=(const Guiding&) = delete;

  std::optional<LobeCacheSet> caches;
  TrainedIllumination training;
  std::optional<GuidedSampler> sampler;
  std::optional<SampleCountModel> counts;
  double secondsLights = 0;  ///< time for learning the choice of lights
  double secondsCounts = 0;  ///< time for learning the counts
  std::optional<Pilot> pilot;

  /// Time spent before rendering.
  double seconds() const {
    return secondsLights + training.report.seconds + secondsCounts + (pilot ? pilot->seconds : 0);
  }
  const LobeCacheSet* cachesOrNull() const { return caches ? &*caches : nullptr; }
  std::size_t unreducedBytes = 0;  ///< size of the records before merging

  void reduceRecords(float threshold) {
    unreducedBytes = training.field.bytes();
    if (threshold > 0) training.field = training.field.reduced(threshold);
  }
};

/// Results of a run other than the picture.
struct RunResult {
  RenderResult render;
  const Guiding& guiding;
  std::uint64_t dropped;

  const TrainingReport& training() const { return guiding.training.report; }
  IntegratorKind integrator(const RenderJob& job) const {
    return guiding.pilot ? guiding.pilot->best() : job.integrator;
  }
  double seconds() const { return guiding.seconds() + render.total.seconds; }
};

/// Times of the steps before training, in seconds.
struct LoadTimes {
  double reading = 0;    ///< reading the scene file, its meshes and images
  double building = 0;   ///< building the acceleration structure and the light tables
  double embree = 0;     ///< the part of `building` spent in Embree
  double restoring = 0;  ///< restoring the illumination from its file
};

nlohmann::ordered_json asJson(const PassReport& pass) {
  return {{"seconds", pass.seconds},
          {"particles", pass.particles},
          {"particles_per_second", static_cast<double>(pass.particles) / pass.seconds},
          {"records", pass.records},
          {"log_likelihood", pass.logLikelihood ? nlohmann::ordered_json(*pass.logLikelihood) : nullptr}};
}

/// Each count divided by the sum of all counts, by name.
template <std::size_t size>
nlohmann::ordered_json fractionsOf(const std::array<std::uint64_t, size>& counts,
                                   const std::array<const char*, size>& names) {
  const double sum = std::accumulate(counts.begin(), counts.end(), 0.0);
  nlohmann::ordered_json fractions;
  for (std::size_t i = 0; i < size; ++i) fractions[names[i]] = sum > 0 ? static_cast<double>(counts[i]) / sum : 0.0;
  return fractions;
}

nlohmann::ordered_json asJson(const std::optional<Pilot>& pilot) {
  if (!pilot) return nullptr;
  const auto one = [](const PilotResult& result) {
    return nlohmann::ordered_json{{"variance", result.variance}, {"cost", result.cost}};
  };
  return {{"seconds", pilot->seconds}, {"path", one(pilot->path)}, {"product", one(pilot->product)}};
}

nlohmann::ordered_json statistics(const RenderJob& job, const LoadTimes& load, const RunResult& run) {
  const PathStatistics& paths = run.render.statistics;
  const RenderProgress& total = run.render.total;
  nlohmann::ordered_json passes = nlohmann::ordered_json::array();
  for (const PassReport& pass : run.training().passes) passes.push_back(asJson(pass));
  return {{"integrator", nameOf(run.integrator(job))},
          {"pilot", asJson(run.guiding.pilot)},
          {"seed", job.seed},
          {"seconds_reading", load.reading},
          {"seconds_building", load.building},
          {"seconds_embree_build", load.embree},
          {"seconds_restoring_illumination", load.restoring},
          {"seconds_total", run.seconds()},
          {"seconds_learning_lights", run.guiding.secondsLights},
          {"seconds_training", run.training().seconds},
          {"seconds_sample_counts", run.guiding.secondsCounts},
          {"seconds_rendering", total.seconds},
          {"spp", total.samples},
          {"rays", paths.rays()},
          {"path_segments", paths.segments},
          {"segments_per_second", static_cast<double>(paths.segments) / total.seconds},
          {"mean_path_length", static_cast<double>(paths.segments) / static_cast<double>(paths.paths)},
          {"peak_rss_bytes", peakResidentBytes()},
          {"training_passes", passes},
          {"training_particles", run.training().particles()},
          {"records", run.guiding.training.field.records()},
          {"records_undersampled_fraction", run.training().undersampledFraction},
          {"record_bytes_before_reduction", run.guiding.unreducedBytes},
          {"record_bytes", run.guiding.training.field.bytes()},
          {"record_components", run.guiding.training.field.meanComponents()},
          {"lobe_components", run.guiding.caches ? run.guiding.caches->meanComponents() : 0.0},
          {"lobe_bytes", run.guiding.caches ? run.guiding.caches->bytes() : 0},
          {"strategy_fractions", fractionsOf(paths.strategies, kScatteringNames)},
          {"guiding_decisions", fractionsOf(paths.decisions, kGuidingDecisionNames)},
          {"nonfinite_samples", run.dropped}};
}

ImageAttributes attributes(const RenderJob& job, std::uint64_t sceneHash, const RunResult& run) {
  ImageAttributes all{{"software", fmt::format("Lobe {}", LOBE_VERSION)},
                      {"integrator", std::string(nameOf(run.integrator(job)))},
                      {"seed", static_cast<double>(job.seed)},
                      {"samples", static_cast<double>(run.render.total.samples)},
                      {"sampleOffset", static_cast<double>(job.sampleOffset)},
                      {"sceneHash", fmt::format("{:016x}", sceneHash)}};
  if (run.guiding.caches) all["cacheHashes"] = fmt::format("{:016x}", fmt::join(run.guiding.caches->hashes(), " "));
  // Only written for --seconds, because pictures rendered with --spp must be byte-identical on every run.
  if (job.seconds) all["seconds"] = run.seconds();
  return all;
}

void train(const RenderJob& job, const RenderScene& scene, const RayCamera& camera, Guiding& guiding) {
  TrainingPlan plan = job.training;
  plan.seed = job.seed;
  plan.keepParticles = job.record.has_value();
  plan.seconds = job.trainSeconds.value_or(job.seconds ? kTrainingFraction * *job.seconds : kInfinity);
  // If the time is limited and --passes is not given, only the time limits the number of passes.
  plan.passes = job.passes.value_or(plan.seconds < kInfinity ? std::numeric_limits<int>::max() : plan.passes);
  const bool timed = plan.seconds < kInfinity;
  Progress progress("training", timed ? plan.seconds : plan.passes);
  guiding.training = trainIllumination(scene, camera, guiding.cachesOrNull(), plan,
                                       [&](const PassReport& pass) { progress.advance(timed ? pass.seconds : 1.0); });
  if (!job.saveIllumination.empty())
    saveIllumination(job.saveIllumination, guiding.training, plan, scene.scene, job.scene);
}

std::string recordFault(const RenderJob& job, const NoRecord& e) {
  return fmt::format("--record {},{}: {}", job.record->first, job.record->second, e.what());
}

/// The surface seen in the pixel of --record.
std::optional<Receiver> receiverFor(const RenderJob& job, const RenderScene& scene, const RayCamera& camera) {
  if (!job.record) return std::nullopt;
  try {
    return receiverAt(scene, camera, job.record->first, job.record->second);
  } catch (const NoRecord& e) {
    throw std::runtime_error(recordFault(job, e));
  }
}

/// Draws the record of --record. If no record serves the surface, prints a warning and the run continues.
void drawRecord(const RenderJob& job, const RenderScene& scene, const Receiver& receiver,
                TrainedIllumination& training) {
  try {
    const RecordView view = viewRecord(scene, receiver, training, job.training.records);
    view.raster.write(job.recordImage);
    std::string line = view.caption;
    std::ranges::replace(line, '\n', ' ');
    printNote(kTool, fmt::format("{}: {}", job.recordImage.string(), line));
  } catch (const NoRecord& e) {
    printWarning(kTool, recordFault(job, e));
  }
  training.particles = {};  // not needed any more; frees memory for rendering
}

/// Learning the counts of samples takes a few percent of the time for rendering.
int pathsForSampleCounts(const RenderJob& job, const RayCamera& camera) {
  constexpr double kFraction = 0.05, kPathsPerSecond = 7000, kFewest = 30000, kMost = 200000;
  const double wanted =
      job.seconds ? kPathsPerSecond * *job.seconds : kFraction * *job.samples * camera.width() * camera.height();
  return static_cast<int>(std::clamp(wanted, kFewest, kMost));
}

void learnCounts(const RenderJob& job, const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                 Guiding& guiding) {
  const Stopwatch watch;
  guiding.counts = learnSampleCounts(scene, camera, options, *guiding.sampler, guiding.training.field.records(),
                                     pathsForSampleCounts(job, camera), job.seed);
  guiding.secondsCounts = watch.seconds();
}

PathOptions pathOptions(const RenderJob& job, const Scene& scene) {
  PathOptions options;
  if (const std::optional<int> depth = job.maxDepth ? job.maxDepth : scene.maxDepth) options.maxDepth = *depth;
  options.emitterVisibility = scene.emitterVisibility;
  return options;
}

std::unique_ptr<Integrator> makeIntegrator(const RenderJob& job, const RenderScene& scene, const RayCamera& camera,
                                           Guiding& guiding) {
  PathOptions options = pathOptions(job, scene.scene);
  auto path = std::make_unique<PathIntegrator>(scene, options);
  if (!guiding.sampler) return path;
  if (job.russianRoulette == RussianRoulette::efficiency) {
    learnCounts(job, scene, camera, options, guiding);
    options.counts = &*guiding.counts;
  }
  auto guided = std::make_unique<GuidedIntegrator>(scene, options, *guiding.sampler);
  if (job.integrator != IntegratorKind::automatic) return guided;
  const Stopwatch watch;
  const auto results =
      comparePilots(camera, std::array<const Integrator*, 2>{path.get(), guided.get()}, {.seed = job.seed});
  guiding.pilot = {results[0], results[1], watch.seconds()};
  if (guiding.pilot->best() == IntegratorKind::path) return path;
  return guided;
}

/// Whether the integrator may sample the product.
bool mayUseProduct(IntegratorKind kind) {
  return kind == IntegratorKind::product || kind == IntegratorKind::automatic;
}

RenderOptions renderOptions(const RenderJob& job, double trained) {
  RenderOptions options{job.seed, job.samples, std::nullopt, job.sampling, job.sampleOffset};
  if (job.seconds) options.seconds = std::max(*job.seconds - trained, 1e-3);
  return options;
}

RenderResult renderWithProgress(const RenderJob& job, const RayCamera& camera, const Integrator& integrator,
                                double trained, Film& film, ConvergenceLog& log) {
  Progress progress("rendering", job.samples ? *job.samples : *job.seconds - trained);
  double done = 0;
  return render(camera, integrator, film, renderOptions(job, trained), [&](const RenderProgress& p) {
    const double now = job.samples ? p.samples : p.seconds;
    progress.advance(now - done);
    done = now;
    log.add(film, trained + p.seconds, p.samples);
  });
}

}  // namespace

void RenderJob::validate() const {
  const auto require = [](bool condition, const std::string& message) {
    if (!condition) throw UsageError(message);
  };
  require(samples || seconds, "--spp or --seconds is required");
  require(!samples || !seconds, "--spp and --seconds cannot be combined");
  require(!samples || *samples >= 1, "--spp must be at least 1");
  require(sampleOffset >= 0, "--sample-offset must be at least 0");
  require(sampleOffset == 0 || samples,
          "--sample-offset requires --spp, because --seconds does not fix the number of samples");
  require(!samples || *samples <= std::numeric_limits<int>::max() - sampleOffset,
          fmt::format("the sum of --sample-offset and --spp must be at most {}", std::numeric_limits<int>::max()));
  require(integrator != IntegratorKind::path || (illumination.empty() && saveIllumination.empty()),
          "--illumination and --save-illumination require --integrator auto, guided or product");
  require(illumination.empty() || saveIllumination.empty(),
          "--save-illumination cannot be combined with --illumination, which replaces training");
  require(!seconds || (*seconds > 0 && std::isfinite(*seconds)), "--seconds must be a finite number greater than 0");
  require(!size || (size->first >= 1 && size->second >= 1 && std::int64_t{size->first} * size->second <= kMaxPixels),
          fmt::format("--size must be at least 1x1 and at most {} pixels", kMaxPixels));
  require(!maxDepth || *maxDepth >= 1, "--max-depth must be at least 1");
  require(!trainSeconds || (*trainSeconds > 0 && std::isfinite(*trainSeconds)),
          "--train-seconds must be a finite number greater than 0");
  require(!trainSeconds || !seconds || *trainSeconds < *seconds, "--train-seconds must be less than --seconds");
  require(!passes || *passes >= 1, "--passes must be at least 1");
  require(reference.empty() == convergence.empty(), "--reference and --convergence require each other");
  require(reduction >= 0 && std::isfinite(reduction), "--reduction must be a finite number of at least 0");
  require(!outputs.empty(), "-o FILE is required");
  require(!record || integrator != IntegratorKind::path, "--record requires --integrator auto, guided or product");
  require(recordImage.extension() == ".png", "--record-image must name a .png file");
  try {
    training.validate();
    for (const auto& output : outputs) checkImageName(output);
  } catch (const std::runtime_error& e) {
    throw UsageError(e.what());  // libraries check their own limits and do not know the command line
  }
}

std::string lobefitCommand(const RenderJob& job) {
  std::string command = fmt::format("lobefit {} -o {}", quoted(job.scene.string()), quoted(job.cacheFolder.string()));
  for (const auto& [name, value] : job.definitions)
    command += fmt::format(" -D {}", quoted(fmt::format("{}={}", name, value)));
  if (job.lenient) command += " --lenient";
  return command;
}

void run(const RenderJob& job) {
  job.validate();
  checkFiles(job);
  std::optional<IlluminationFile> stored;
  if (!job.illumination.empty()) stored.emplace(IlluminationFile::open(job.illumination));
  LoadTimes load;
  const Stopwatch reading;
  const Scene scene = readFor(job);
  load.reading = reading.seconds();
  ConvergenceLog log(job, scene);
  Guiding guiding;
  if (stored) {
    const Stopwatch restoring;
    guiding.training = restoreIllumination(*stored, job.illumination, scene);
    if (mayUseProduct(job.integrator) && !guiding.training.report.learntFractions)
      printNote(kTool, fmt::format("{}: the records have learnt no BSDF sampling fractions (trained by guided, or with "
                                   "--bsdf-fraction fixed); all use {:.1f}",
                                   job.illumination.string(), kInitialBsdfFraction));
    load.restoring = restoring.seconds();
  }
  if (mayUseProduct(job.integrator))
    guiding.caches.emplace(job.cacheFolder, lobeRequests(scene), lobefitCommand(job), job.reduction);
  const Stopwatch building;
  RenderScene renderScene(scene, job.shadowSurfaces);
  load.building = building.seconds();
  load.embree = renderScene.tracer.buildSeconds();
  const RayCamera camera(scene.camera, scene.filter);
  const Stopwatch learning;
  renderScene.lights.use(learnLightCells(renderScene, camera, job.seed));
  guiding.secondsLights = learning.seconds();
  const std::optional<Receiver> receiver = receiverFor(job, renderScene, camera);
  if (job.integrator != IntegratorKind::path) {
    if (!stored) train(job, renderScene, camera, guiding);
    guiding.reduceRecords(job.reduction);
    guiding.sampler.emplace(scene, guiding.training.field, guiding.cachesOrNull());
  }
  if (receiver) drawRecord(job, renderScene, *receiver, guiding.training);

  const std::unique_ptr<Integrator> integrator = makeIntegrator(job, renderScene, camera, guiding);
  Film film(camera.width(), camera.height());
  const RenderResult rendered = renderWithProgress(job, camera, *integrator, guiding.seconds(), film, log);
  const RunResult result{rendered, guiding, film.dropped()};
  if (result.dropped > 0)
    printWarning(kTool, fmt::format("{} samples were negative or not finite, and were discarded", result.dropped));
  const std::uint64_t hash = pictureHash(scene);
  for (const auto& output : job.outputs) writeImage(output, film.mean(), attributes(job, hash, result));
  log.write();
  if (!job.stats.empty()) writeAtomically(job.stats, statistics(job, load, result).dump(2) + "\n");
}

}  // namespace lobe
