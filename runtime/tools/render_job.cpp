#include "runtime/tools/render_job.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <new>
#include <numeric>
#include <stdexcept>
#include <variant>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/resource.h>

#include <nlohmann/json.hpp>

#include "runtime/analysis/record_view.h"
#include "runtime/core/atomic_file.h"
#include "runtime/core/stopwatch.h"
#include "runtime/image/error_metrics.h"
#include "runtime/image/image_output.h"
#include "runtime/render/integrators/bidirectional_integrator.h"
#include "runtime/render/integrators/learn_sample_counts.h"
#include "runtime/render/integrators/pilot.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/light_learning.h"
#include "runtime/tools/checkpoint.h"
#include "runtime/tools/json_text.h"
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

std::vector<std::filesystem::path> writtenBy(const RenderJob& job) {
  std::vector<std::filesystem::path> written = job.outputs;
  for (const auto& path : {job.convergence, job.stats, job.saveIllumination, job.checkpoint})
    if (!path.empty()) written.push_back(path);
  if (job.record) written.push_back(job.recordImage);
  return written;
}

/// Checks before the work starts that all output files can be written and are distinct from each other and from the
/// inputs. The checkpoint that a run continues may be replaced by its own.
void checkFiles(const RenderJob& job) {
  const std::vector<std::filesystem::path> written = writtenBy(job);
  std::map<std::filesystem::path, int> uses;
  for (const auto& path : {job.scene, job.reference, job.illumination})
    if (!path.empty()) ++uses[placeOf(path)];
  if (!job.resume.empty() && (job.checkpoint.empty() || placeOf(job.resume) != placeOf(job.checkpoint)))
    ++uses[placeOf(job.resume)];
  for (const auto& path : written)
    if (++uses[placeOf(path)] > 1)
      throw UsageError(fmt::format("{}: is used for more than one file, and would be overwritten", path.string()));
  for (const auto& path : written) checkWritable(path);
}

/// Checks that no output replaces a file of the scene or a BRDF cache.
void checkSceneFiles(const RenderJob& job, const Scene& scene) {
  std::vector<std::filesystem::path> read = scene.files;
  if (job.mayUseProduct())
    for (const LobeRequest& request : lobeRequests(scene))
      read.push_back(job.cacheFolder / lobeFileName(request.model, request.key));
  for (const auto& path : writtenBy(job)) checkNotRead(path, read);
}

/// Collects the errors of outputs, so that one that fails does not prevent the others.
class OutputErrors {
 public:
  void attempt(const std::filesystem::path& path, const std::function<void()>& write) {
    try {
      write();
    } catch (const std::bad_alloc&) {
      errors_.push_back(path.string() + ": not enough memory");
    } catch (const std::exception& e) {
      errors_.emplace_back(e.what());
    }
  }
  const std::vector<std::string>& all() const { return errors_; }

 private:
  std::vector<std::string> errors_;
};

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

/// BRDF caches and trained illumination; both are empty without guiding. Cannot be moved, because the samplers refer to
/// the other members.
struct Guiding {
  Guiding() = default;
  Guiding(const Guiding&) = delete;
  Guiding& operator=(const Guiding&) = delete;

  std::optional<LobeCacheSet> caches;
  TrainedIllumination training;
  std::optional<GuidedSampler> sampler;
  std::optional<GuidedSampler> lightSampler;  ///< of the light paths of bdpt
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

/// Results of a run, or of the part so far.
struct RunResult {
  RenderResult render;
  const Guiding& guiding;
  const Film& film;

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
          {"nonfinite_samples", run.film.dropped()}};
}

ImageAttributes attributes(const RenderJob& job, std::uint64_t sceneHash, const RunResult& run) {
  ImageAttributes all{{"software", fmt::format("Lobe {}", LOBE_VERSION)},
                      {"integrator", std::string(nameOf(run.integrator(job)))},
                      {"seed", static_cast<double>(job.seed)},
                      {"sampleOffset", static_cast<double>(job.sampleOffset)},
                      {"sceneHash", fmt::format("{:016x}", sceneHash)}};
  const auto [least, most] = run.film.sampleRange();
  if (least == most)
    all["samples"] = static_cast<double>(least);
  else  // without "samples", so that such a picture is not merged as if all pixels had equally many
    all["interrupted"] = fmt::format("{} to {} samples per pixel", least, most);
  if (run.guiding.caches) all["cacheHashes"] = fmt::format("{:016x}", fmt::join(run.guiding.caches->hashes(), " "));
  // Only written for --seconds, because pictures rendered with --spp must be byte-identical on every run.
  if (job.seconds) all["seconds"] = run.seconds();
  return all;
}

TrainingPlan planOf(const RenderJob& job) {
  TrainingPlan plan = job.training;
  plan.seed = job.seed;
  plan.keepParticles = job.record.has_value();
  plan.keepImportance = job.integrator == IntegratorKind::bdpt;
  plan.seconds = job.trainSeconds.value_or(job.seconds ? kTrainingFraction * *job.seconds : kInfinity);
  // If the time is limited and --passes is not given, only the time limits the number of passes.
  plan.passes = job.passes.value_or(plan.seconds < kInfinity ? std::numeric_limits<int>::max() : plan.passes);
  return plan;
}

void train(const TrainingPlan& plan, const RenderScene& scene, const RayCamera& camera, Guiding& guiding) {
  const bool timed = plan.seconds < kInfinity;
  Progress progress("training", timed ? plan.seconds : plan.passes);
  guiding.training = trainIllumination(scene, camera, guiding.cachesOrNull(), plan,
                                       [&](const PassReport& pass) { progress.advance(timed ? pass.seconds : 1.0); });
}

/// Everything that determines the samples of a picture, except for their number and time limits of training.
RunSettings settingsOf(const RenderJob& job, const Scene& scene, const Guiding& guiding,
                       const std::optional<IlluminationFile>& stored) {
  const FilmCrop picture = scene.camera.picture();
  RunSettings all{{"the version of Lobe", LOBE_VERSION},
                  {"--integrator", nameOf(job.integrator)},
                  {"the size", fmt::format("{}x{}", picture.width, picture.height)},
                  {"--seed", std::to_string(job.seed)},
                  {"--sampler", job.sampling == PixelSampling::sobol ? "sobol" : "independent"},
                  {"--sample-offset", std::to_string(job.sampleOffset)},
                  {"--max-depth", job.maxDepth ? std::to_string(*job.maxDepth) : "that of the scene"},
                  {"--shadow-surfaces", std::to_string(job.shadowSurfaces)},
                  {"the hash of scene and camera", fmt::format("{:016x}", pictureHash(scene))}};
  if (job.integrator == IntegratorKind::bdpt) all.emplace_back("--guide", nameOf(job.guide));
  if (job.integrator == IntegratorKind::vcm) {
    all.emplace_back("--merge-radius", fmt::format("{}", job.merge.first));
    all.emplace_back("--merge-alpha", fmt::format("{}", job.merge.alpha));
  }
  if (!job.guided()) return all;
  const TrainingPlan& plan = job.training;
  const auto names = trainFromNames();
  const auto from = std::ranges::find(names, plan.from, [](const auto& entry) { return entry.second; });
  all.emplace_back("--reduction", fmt::format("{}", job.reduction));
  all.emplace_back("--russian-roulette",
                   job.russianRoulette == RussianRoulette::efficiency ? "efficiency" : "throughput");
  all.emplace_back("the hash of --illumination", stored ? fmt::format("{:016x}", stored->header().hash) : "none");
  all.emplace_back("--train", from->first);
  all.emplace_back("--passes", job.passes ? std::to_string(*job.passes) : "the default");
  all.emplace_back("--photons", std::to_string(plan.photons));
  all.emplace_back("--importons", std::to_string(plan.importons));
  all.emplace_back("--components", std::to_string(plan.records.components));
  all.emplace_back("--bsdf-fraction", plan.learnFractions ? "learnt" : "fixed");
  if (guiding.caches)
    all.emplace_back("the hash of the BRDF caches", fmt::format("{:016x}", fmt::join(guiding.caches->hashes(), " ")));
  return all;
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

/// The fraction of a full-sized pilot, and of the paths for learning counts, so that both take a few percent of the
/// time of a short run. With --spp it does not depend on the number of samples, so that parts of a picture
/// (--sample-offset) use the same counts and the same integrator.
double preparationSize(const RenderJob& job) {
  constexpr double kLeast = 0.2, kSeconds = 10;
  return job.seconds ? std::clamp(*job.seconds / kSeconds, kLeast, 1.0) : 1.0;
}

void learnCounts(const RenderJob& job, const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                 Guiding& guiding) {
  constexpr double kPaths = 100000;
  const Stopwatch watch;
  guiding.counts = learnSampleCounts(scene, camera, options, *guiding.sampler, guiding.training.field.records(),
                                     static_cast<int>(kPaths * preparationSize(job)), job.seed);
  guiding.secondsCounts = watch.seconds();
}

PathOptions pathOptions(const RenderJob& job, const Scene& scene) {
  PathOptions options;
  if (const std::optional<int> depth = job.maxDepth ? job.maxDepth : scene.maxDepth) options.maxDepth = *depth;
  options.emitterVisibility = scene.emitterVisibility;
  return options;
}

using AnyIntegrator = std::variant<std::unique_ptr<Integrator>, std::unique_ptr<BidirectionalIntegrator>>;

/// path, guided or product.
std::unique_ptr<Integrator> makeUnidirectional(const RenderJob& job, const RenderScene& scene, const RayCamera& camera,
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
  PilotOptions pilot;
  pilot.tiles = static_cast<int>(pilot.tiles * preparationSize(job));
  pilot.seed = job.seed;
  // The same picture for a seed is only promised for --spp.
  pilot.timed = job.seconds.has_value();
  const auto results = comparePilots(camera, std::array<const Integrator*, 2>{path.get(), guided.get()}, pilot);
  guiding.pilot = {results[0], results[1], watch.seconds()};
  if (guiding.pilot->best() == IntegratorKind::path) return path;
  return guided;
}

std::unique_ptr<BidirectionalIntegrator> makeBdpt(const RenderJob& job, const RenderScene& scene,
                                                  const RayCamera& camera, const Guiding& guiding) {
  const PathOptions options = pathOptions(job, scene.scene);
  if (!guiding.sampler) return std::make_unique<BdptIntegrator>(scene, camera, options);
  return std::make_unique<GuidedBdptIntegrator>(scene, camera, options, *guiding.sampler, *guiding.lightSampler);
}

std::unique_ptr<BidirectionalIntegrator> makeVcm(const RenderJob& job, const RenderScene& scene,
                                                 const RayCamera& camera) {
  const float diagonal = scene.tracer.bounds().isEmpty() ? 1.0f : scene.tracer.bounds().diagonal().norm();
  const MergeRadius radius{job.merge.first * diagonal, job.merge.alpha};
  return std::make_unique<VcmIntegrator>(scene, camera, pathOptions(job, scene.scene), radius);
}

AnyIntegrator makeIntegrator(const RenderJob& job, const RenderScene& scene, const RayCamera& camera,
                             Guiding& guiding) {
  if (job.integrator == IntegratorKind::bdpt) return makeBdpt(job, scene, camera, guiding);
  if (job.integrator == IntegratorKind::vcm) return makeVcm(job, scene, camera);
  return makeUnidirectional(job, scene, camera, guiding);
}

/// One run, step by step. Cannot be moved, because members refer to others.
class Run {
 public:
  Run(const RenderJob& job, const StopFlag& stop) : job_(job), stop_(stop) {}
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// Everything before the first sample. Writes only the plot of a record.
  void prepare();
  /// Renders, with snapshots, until the end or until it is stopped.
  void render();
  /// Writes the outputs, and throws if one of them cannot be written, or if the run was stopped.
  void finish();

 private:
  void readCheckpoint();
  void readStored(const IlluminationFile& file);
  void readIllumination(const IlluminationFile& file, const std::filesystem::path& path);
  void makeGuiding();
  void saveTraining();
  RenderOptions options() const;
  double fractionDone() const;
  bool snapshotIsDue() const;
  void snapshot();
  void writeOutputs(OutputErrors& errors) const;
  void writeCheckpoint(OutputErrors& errors) const;
  std::string stopMessage() const;
  double prepared() const { return guiding_.seconds(); }

  const RenderJob& job_;
  const StopFlag& stop_;
  LoadTimes load_;
  std::optional<CheckpointFile> resumed_;
  std::optional<Scene> scene_;
  std::optional<RenderScene> renderScene_;
  std::optional<RayCamera> camera_;
  std::optional<ConvergenceLog> log_;
  Guiding guiding_;
  // For checkpoints and --save-illumination: the content of .illum files.
  std::vector<std::byte> illumination_, importance_;
  RunSettings settings_;
  AnyIntegrator integrator_;
  std::optional<Film> film_;
  RenderResult result_;
  OutputErrors errors_;
  Stopwatch sinceSnapshot_;
};

void Run::prepare() {
  if (!job_.resume.empty()) resumed_.emplace(CheckpointFile::open(job_.resume));
  std::optional<IlluminationFile> stored;
  if (!job_.illumination.empty()) stored.emplace(IlluminationFile::open(job_.illumination));
  const Stopwatch reading;
  scene_.emplace(readFor(job_));
  load_.reading = reading.seconds();
  checkSceneFiles(job_, *scene_);
  log_.emplace(job_, *scene_);
  if (job_.mayUseProduct())
    guiding_.caches.emplace(job_.cacheFolder, lobeRequests(*scene_), lobefitCommand(job_), job_.reduction);
  settings_ = settingsOf(job_, *scene_, guiding_, stored);
  if (resumed_)
    readCheckpoint();
  else if (stored)
    readStored(*stored);
  const Stopwatch building;
  renderScene_.emplace(*scene_, job_.shadowSurfaces);
  load_.building = building.seconds();
  load_.embree = renderScene_->tracer.buildSeconds();
  camera_.emplace(scene_->camera, scene_->filter);
  const Stopwatch learning;
  renderScene_->lights.use(learnLightCells(*renderScene_, *camera_, job_.seed));
  guiding_.secondsLights = learning.seconds();
  if (!film_) film_.emplace(camera_->width(), camera_->height());
  if (!job_.checkpoint.empty() && film_->pixels().size() > kMaxCheckpointPixels)
    throw std::runtime_error(fmt::format("--checkpoint: a checkpoint holds at most {} pixels", kMaxCheckpointPixels));
  const std::optional<Receiver> receiver = receiverFor(job_, *renderScene_, *camera_);
  if (job_.guided()) makeGuiding();
  if (receiver) drawRecord(job_, *renderScene_, *receiver, guiding_.training);
  integrator_ = makeIntegrator(job_, *renderScene_, *camera_, guiding_);
}

void Run::readCheckpoint() {
  checkSameRun(*resumed_, job_.resume, settings_);
  const FilmCrop picture = scene_->camera.picture();
  film_.emplace(filmOf(*resumed_));
  if (film_->width() != picture.width || film_->height() != picture.height)
    throw std::runtime_error(fmt::format("{}: damaged: the film has another size", job_.resume.string()));
  result_ = resultOf(*resumed_, job_.resume);
  const auto [least, most] = film_->sampleRange();
  if (job_.samples && most > static_cast<std::uint32_t>(*job_.samples))
    throw std::runtime_error(fmt::format("{}: has {} samples per pixel already, more than --spp {}",
                                         job_.resume.string(), most, *job_.samples));
  if (job_.guided()) readIllumination(IlluminationFile::parse(resumed_->illumination(), job_.resume), job_.resume);
  if (!resumed_->importance().empty())
    guiding_.training.importance =
        restoreIllumination(IlluminationFile::parse(resumed_->importance(), job_.resume), job_.resume, *scene_).field;
  guiding_.training.report = trainingOf(*resumed_);
  printNote(kTool, fmt::format("{}: continues with sample {} of each pixel", job_.resume.string(), least + 1));
}

void Run::readStored(const IlluminationFile& file) {
  readIllumination(file, job_.illumination);
  if (job_.integrator == IntegratorKind::bdpt)
    printNote(kTool, fmt::format("{}: holds no importance, so light paths are not guided", job_.illumination.string()));
}

void Run::readIllumination(const IlluminationFile& file, const std::filesystem::path& path) {
  const Stopwatch restoring;
  guiding_.training = restoreIllumination(file, path, *scene_);
  if (job_.mayUseProduct() && job_.training.learnFractions && !guiding_.training.report.learntFractions)
    printNote(kTool, fmt::format("{}: the records have learnt no BSDF sampling fractions (trained by guided, or with "
                                 "--bsdf-fraction fixed); all use {:.1f}",
                                 path.string(), kInitialBsdfFraction));
  load_.restoring = restoring.seconds();
}

void Run::makeGuiding() {
  const TrainingPlan plan = planOf(job_);
  if (!resumed_ && job_.illumination.empty()) train(plan, *renderScene_, *camera_, guiding_);
  if (!job_.checkpoint.empty() || !job_.saveIllumination.empty())
    illumination_ = encodeIllumination(guiding_.training, plan, *scene_, job_.scene);
  if (!job_.checkpoint.empty() && guiding_.training.importance.records() > 0)
    importance_ =
        encodeIllumination({guiding_.training.importance, guiding_.training.report, {}, {}}, plan, *scene_, job_.scene);
  guiding_.reduceRecords(job_.reduction);
  guiding_.sampler.emplace(*scene_, guiding_.training.field, guiding_.cachesOrNull());
  guiding_.lightSampler.emplace(*scene_, guiding_.training.importance, nullptr);
}

/// Writes what a later run would have to train again otherwise. Failures do not prevent rendering.
void Run::saveTraining() {
  if (!job_.saveIllumination.empty())
    errors_.attempt(job_.saveIllumination,
                    [&] { writeAtomically(job_.saveIllumination, std::span<const std::byte>(illumination_)); });
  for (const std::string& error : errors_.all()) printWarning(kTool, error + "; rendering goes on");
  OutputErrors ofCheckpoint;  // it is written again later
  writeCheckpoint(ofCheckpoint);
  for (const std::string& error : ofCheckpoint.all()) printWarning(kTool, error);
}

RenderOptions Run::options() const {
  RenderOptions options{job_.seed, job_.samples, std::nullopt, job_.sampling, job_.sampleOffset};
  if (job_.seconds) options.seconds = std::max(*job_.seconds - prepared(), 1e-3);
  if (const double every = job_.snapshotEvery.value_or(RenderJob::kSnapshotSeconds); every > 0)
    options.longestWave = every;
  options.stop = &stop_;
  return options;
}

double Run::fractionDone() const {
  return job_.samples ? static_cast<double>(result_.total.samples) / *job_.samples
                      : (prepared() + result_.total.seconds) / *job_.seconds;
}

bool Run::snapshotIsDue() const {
  const double every = job_.snapshotEvery.value_or(RenderJob::kSnapshotSeconds);
  if (every == 0 || sinceSnapshot_.seconds() < every || fractionDone() >= 1) return false;
  const double expected = (prepared() + result_.total.seconds) / fractionDone();
  return job_.snapshotEvery || !job_.checkpoint.empty() || expected > RenderJob::kLongRun;
}

void Run::snapshot() {
  OutputErrors errors;
  writeOutputs(errors);
  for (const std::string& error : errors.all()) printWarning(kTool, error);
  sinceSnapshot_ = Stopwatch();
}

void Run::render() {
  saveTraining();
  Progress progress("rendering", 1);
  double done = 0;
  sinceSnapshot_ = Stopwatch();
  const auto afterWave = [&](const RenderResult& result) {
    result_ = result;
    progress.advance(fractionDone() - done);
    done = fractionDone();
    log_->add(*film_, prepared() + result.total.seconds, result.total.samples);
    if (snapshotIsDue()) snapshot();
  };
  result_ = std::visit(
      [&](const auto& integrator) {
        return lobe::render(*camera_, *integrator, *film_, options(), afterWave, result_);
      },
      integrator_);
}

void Run::writeOutputs(OutputErrors& errors) const {
  const RunResult result{result_, guiding_, *film_};
  const std::uint64_t hash = pictureHash(*scene_);
  for (const auto& output : job_.outputs)
    errors.attempt(output, [&] { writeImage(output, film_->mean(), attributes(job_, hash, result)); });
  errors.attempt(job_.convergence, [&] { log_->write(); });
  if (!job_.stats.empty())
    errors.attempt(job_.stats, [&] { writeAtomically(job_.stats, jsonText(statistics(job_, load_, result)) + "\n"); });
  writeCheckpoint(errors);
}

void Run::writeCheckpoint(OutputErrors& errors) const {
  if (job_.checkpoint.empty()) return;
  errors.attempt(job_.checkpoint, [&] {
    const std::vector<std::byte> bytes =
        encodeCheckpoint(settings_, *film_, result_, guiding_.training.report, illumination_, importance_);
    writeAtomically(job_.checkpoint, std::span<const std::byte>(bytes));
  });
}

std::string Run::stopMessage() const {
  const auto [least, most] = film_->sampleRange();
  std::string message = least == most ? fmt::format("{}", least) : fmt::format("{} to {}", least, most);
  if (job_.samples) message += fmt::format(" of {}", *job_.samples);
  message += most > 0 ? " samples per pixel are rendered and written" : " samples per pixel, so no picture is written";
  if (!job_.checkpoint.empty()) message += fmt::format("; --resume {} goes on", quoted(job_.checkpoint.string()));
  return message;
}

void Run::finish() {
  if (const std::uint64_t dropped = film_->dropped(); dropped > 0)
    printWarning(kTool, fmt::format("{} samples were negative or not finite, and were discarded", dropped));
  if (film_->sampleRange().second > 0)
    writeOutputs(errors_);
  else
    writeCheckpoint(errors_);
  if (result_.stopped && errors_.all().empty()) throw Stopped(stopMessage());
  if (result_.stopped) printWarning(kTool, "interrupted: " + stopMessage());
  if (!errors_.all().empty()) throw std::runtime_error(fmt::format("{}", fmt::join(errors_.all(), "\n")));
}

}  // namespace

const char* nameOf(IntegratorKind kind) {
  constexpr std::array names{"auto", "path", "bdpt", "vcm", "guided", "product"};
  return names[static_cast<std::size_t>(kind)];
}

const char* nameOf(BdptGuide guide) {
  constexpr std::array names{"none", "illumination", "product"};
  return names[static_cast<std::size_t>(guide)];
}

bool RenderJob::guided() const {
  return integrator == IntegratorKind::bdpt ? guide != BdptGuide::none
                                            : integrator == IntegratorKind::guided || mayUseProduct();
}

bool RenderJob::mayUseProduct() const {
  if (integrator == IntegratorKind::bdpt) return guide == BdptGuide::product;
  return integrator == IntegratorKind::product || integrator == IntegratorKind::automatic;
}

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
  require(guided() || (illumination.empty() && saveIllumination.empty()),
          "--illumination and --save-illumination require --integrator auto, guided or product, or bdpt with --guide");
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
  require(!record || guided(), "--record requires --integrator auto, guided or product, or bdpt with --guide");
  require(merge.first > 0 && std::isfinite(merge.first), "--merge-radius must be a finite number greater than 0");
  require(merge.alpha > 0 && merge.alpha <= 1, "--merge-alpha must be greater than 0 and at most 1");
  require(!snapshotEvery || (*snapshotEvery >= 0 && std::isfinite(*snapshotEvery)),
          "--snapshot-every must be a finite number of at least 0");
  require(resume.empty() || !record, "--record cannot be combined with --resume, because the particles are not stored");
  require(resume.empty() || convergence.empty(),
          "--convergence cannot be combined with --resume, because the earlier errors are not stored");
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

void run(const RenderJob& job, const StopFlag& stop) {
  job.validate();
  checkFiles(job);
  Run run(job, stop);
  stoppable(stop, "before the first sample, so no picture is written", [&] { run.prepare(); });
  run.render();
  run.finish();
}

}  // namespace lobe
