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
#include "runtime/render/integrators/path_integrator.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/tools/stored_illumination.h"
#include "runtime/tools/tool.h"
#include "scenes/camera.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_hash.h"

namespace lobe {
namespace {

constexpr const char* kTool = "loberender";
// Of --seconds. In the kitchen at 60 seconds a sample after 11 seconds of training has the variance of one after 21.
constexpr double kTrainingFraction = 0.15;
constexpr std::int64_t kMaxPixels = 1 << 28;  // a film of more is a slip of the finger

const char* nameOf(IntegratorKind kind) {
  constexpr std::array names{"path", "guided", "product"};
  return names[static_cast<std::size_t>(kind)];
}

/// As a shell takes it for one word.
std::string quoted(const std::string& word) {
  const auto plain = [](unsigned char c) { return std::isalnum(c) || c >= 0x80 || std::strchr("/._-=+,:@%", c); };
  if (!word.empty() && std::ranges::all_of(word, plain)) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? "'\\''" : std::string(1, c);
  return text + "'";
}

/// The same for all ways to write a path.
std::filesystem::path placeOf(const std::filesystem::path& path) {
  return std::filesystem::weakly_canonical(std::filesystem::absolute(path));
}

/// Every file a job writes can be written and is a file of its own: better said now than after hours.
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
      throw UsageError(fmt::format("{}: would be overwritten, it is named twice", path.string()));
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
    printWarning(kTool, fmt::format("{}: nothing emits light: the picture is black", job.scene.string()));
  if (job.size) {
    if (scene.camera.crop) printWarning(kTool, "--size is that of the whole film: the file's crop is dropped");
    scene.camera.crop.reset();
    scene.camera.width = job.size->first;
    scene.camera.height = job.size->second;
    scene.camera.horizontalFov = horizontalFov(scene.camera, scene.camera.width, scene.camera.height);
  }
  return scene;
}

/// Error against time, a line a wave.
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

/// The caches and what was learnt; neither for `path`. Not moved: the sampler refers to the others.
struct Guiding {
  Guiding() = default;
  Guiding(const Guiding&) = delete;
  Guiding& operator=(const Guiding&) = delete;

  std::optional<LobeCacheSet> caches;
  TrainedIllumination training;
  std::optional<GuidedSampler> sampler;

  const LobeCacheSet* cachesOrNull() const { return caches ? &*caches : nullptr; }
  std::size_t unreducedBytes = 0;  ///< of the records

  void reduceRecords(float threshold) {
    unreducedBytes = training.field.bytes();
    if (threshold > 0) training.field = training.field.reduced(threshold);
  }
};

/// What a run leaves besides the picture.
struct RunResult {
  RenderResult render;
  const Guiding& guiding;
  std::uint64_t dropped;

  const TrainingReport& training() const { return guiding.training.report; }
  double seconds() const { return training().seconds + render.total.seconds; }
};

/// What comes before.
struct LoadTimes {
  double reading = 0;    ///< the scene file, its meshes and images
  double building = 0;   ///< acceleration structure and light tables
  double embree = 0;     ///< Embree's share of it
  double restoring = 0;  ///< illumination from its file
};

nlohmann::ordered_json asJson(const PassReport& pass) {
  return {{"seconds", pass.seconds},
          {"particles", pass.particles},
          {"particles_per_second", static_cast<double>(pass.particles) / pass.seconds},
          {"records", pass.records},
          {"log_likelihood", pass.logLikelihood ? nlohmann::ordered_json(*pass.logLikelihood) : nullptr}};
}

/// Counts over their sum, by name.
template <std::size_t size>
nlohmann::ordered_json fractionsOf(const std::array<std::uint64_t, size>& counts,
                                   const std::array<const char*, size>& names) {
  const double sum = std::accumulate(counts.begin(), counts.end(), 0.0);
  nlohmann::ordered_json fractions;
  for (std::size_t i = 0; i < size; ++i) fractions[names[i]] = sum > 0 ? static_cast<double>(counts[i]) / sum : 0.0;
  return fractions;
}

nlohmann::ordered_json statistics(const RenderJob& job, const LoadTimes& load, const RunResult& run) {
  const PathStatistics& paths = run.render.statistics;
  const RenderProgress& total = run.render.total;
  nlohmann::ordered_json passes = nlohmann::ordered_json::array();
  for (const PassReport& pass : run.training().passes) passes.push_back(asJson(pass));
  return {{"integrator", nameOf(job.integrator)},
          {"seed", job.seed},
          {"seconds_reading", load.reading},
          {"seconds_building", load.building},
          {"seconds_embree_build", load.embree},
          {"seconds_restoring_illumination", load.restoring},
          {"seconds_total", run.seconds()},
          {"seconds_training", run.training().seconds},
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
                      {"integrator", std::string(nameOf(job.integrator))},
                      {"seed", static_cast<double>(job.seed)},
                      {"samples", static_cast<double>(run.render.total.samples)},
                      {"sampleOffset", static_cast<double>(job.sampleOffset)},
                      {"sceneHash", fmt::format("{:016x}", sceneHash)}};
  if (run.guiding.caches) all["cacheHashes"] = fmt::format("{:016x}", fmt::join(run.guiding.caches->hashes(), " "));
  // A picture of so many samples is the same bytes on every run; one of so many seconds never is.
  if (job.seconds) all["seconds"] = run.seconds();
  return all;
}

void train(const RenderJob& job, const RenderScene& scene, const RayCamera& camera, Guiding& guiding) {
  TrainingPlan plan = job.training;
  plan.seed = job.seed;
  plan.keepParticles = job.record.has_value();
  plan.seconds = job.trainSeconds.value_or(job.seconds ? kTrainingFraction * *job.seconds : kInfinity);
  // Only time limits the passes where there is no other reason to stop.
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

/// What the pixel of --record shows.
std::optional<Receiver> receiverFor(const RenderJob& job, const RenderScene& scene, const RayCamera& camera) {
  if (!job.record) return std::nullopt;
  try {
    return receiverAt(scene, camera, job.record->first, job.record->second);
  } catch (const NoRecord& e) {
    throw std::runtime_error(recordFault(job, e));
  }
}

/// Where nothing was learnt there is nothing to draw; the picture is made all the same.
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
  training.particles = {};  // drawn: rendering needs the memory more
}

std::unique_ptr<Integrator> makeIntegrator(const RenderJob& job, const RenderScene& scene, const Guiding& guiding) {
  PathOptions options;
  if (const std::optional<int> depth = job.maxDepth ? job.maxDepth : scene.scene.maxDepth) options.maxDepth = *depth;
  options.emitterVisibility = scene.scene.emitterVisibility;
  options.russianRoulette = job.russianRoulette;
  if (!guiding.sampler) return std::make_unique<PathIntegrator>(scene, options);
  return std::make_unique<GuidedIntegrator>(scene, options, *guiding.sampler);
}

RenderOptions renderOptions(const RenderJob& job, double trained) {
  RenderOptions options{job.seed, job.samples, std::nullopt, job.sampleOffset};
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
  require(samples || seconds, "either --spp or --seconds has to be given");
  require(!samples || !seconds, "--spp and --seconds do not go together");
  require(!samples || *samples >= 1, "--spp has to be at least 1");
  require(sampleOffset >= 0, "--sample-offset has to be at least 0");
  require(sampleOffset == 0 || samples,
          "--sample-offset goes with --spp: samples of --seconds are not known beforehand");
  require(!samples || *samples <= std::numeric_limits<int>::max() - sampleOffset,
          fmt::format("--sample-offset and --spp together have to be at most {}", std::numeric_limits<int>::max()));
  require(integrator != IntegratorKind::path || (illumination.empty() && saveIllumination.empty()),
          "--illumination and --save-illumination are for guided and product, path has none");
  require(illumination.empty() || saveIllumination.empty(),
          "--save-illumination keeps what is trained, but with --illumination nothing is");
  require(!seconds || (*seconds > 0 && std::isfinite(*seconds)), "--seconds has to be a finite number over 0");
  require(!size || (size->first >= 1 && size->second >= 1 && std::int64_t{size->first} * size->second <= kMaxPixels),
          fmt::format("--size has to be at least 1x1 and at most {} pixels", kMaxPixels));
  require(!maxDepth || *maxDepth >= 1, "--max-depth has to be at least 1");
  require(!trainSeconds || (*trainSeconds > 0 && std::isfinite(*trainSeconds)),
          "--train-seconds has to be a finite number over 0");
  require(!trainSeconds || !seconds || *trainSeconds < *seconds, "--train-seconds has to be less than --seconds");
  require(!passes || *passes >= 1, "--passes has to be at least 1");
  require(reference.empty() == convergence.empty(), "--reference and --convergence go together");
  require(reduction >= 0 && std::isfinite(reduction), "--reduction has to be a finite number, at least 0");
  require(!outputs.empty(), "-o is missing");
  require(!record || integrator != IntegratorKind::path, "--record is for guided and product: path learns nothing");
  require(recordImage.extension() == ".png", "--record-image is written as .png");
  try {
    training.validate();
    for (const auto& output : outputs) checkImageName(output);
  } catch (const std::runtime_error& e) {
    throw UsageError(e.what());  // rules of libraries, which know no command line
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
    if (job.integrator == IntegratorKind::product && !guiding.training.report.learntFractions)
      printNote(kTool, fmt::format("{}: its records have learnt no BSDF sampling fractions (trained by guided, or with "
                                   "--bsdf-fraction fixed): all have {:.1f}",
                                   job.illumination.string(), kInitialBsdfFraction));
    load.restoring = restoring.seconds();
  }
  if (job.integrator == IntegratorKind::product)
    guiding.caches.emplace(job.cacheFolder, lobeRequests(scene), lobefitCommand(job), job.reduction);
  const Stopwatch building;
  const RenderScene renderScene(scene);
  load.building = building.seconds();
  load.embree = renderScene.tracer.buildSeconds();
  const RayCamera camera(scene.camera, scene.filter);
  const std::optional<Receiver> receiver = receiverFor(job, renderScene, camera);
  if (job.integrator != IntegratorKind::path) {
    if (!stored) train(job, renderScene, camera, guiding);
    guiding.reduceRecords(job.reduction);
    guiding.sampler.emplace(scene, guiding.training.field, guiding.cachesOrNull());
  }
  if (receiver) drawRecord(job, renderScene, *receiver, guiding.training);

  const std::unique_ptr<Integrator> integrator = makeIntegrator(job, renderScene, guiding);
  Film film(camera.width(), camera.height());
  const RenderResult rendered =
      renderWithProgress(job, camera, *integrator, guiding.training.report.seconds, film, log);
  const RunResult result{rendered, guiding, film.dropped()};
  if (result.dropped > 0)
    printWarning(kTool, fmt::format("{} samples were negative or not finite and left out", result.dropped));
  const std::uint64_t hash = pictureHash(scene);
  for (const auto& output : job.outputs) writeImage(output, film.mean(), attributes(job, hash, result));
  log.write();
  if (!job.stats.empty()) writeAtomically(job.stats, statistics(job, load, result).dump(2) + "\n");
}

}  // namespace lobe
