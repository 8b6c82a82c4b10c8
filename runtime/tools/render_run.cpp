#include "runtime/tools/render_run.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/analysis/record_view.h"
#include "runtime/core/atomic_file.h"
#include "runtime/core/files.h"
#include "runtime/core/stop.h"
#include "runtime/core/stopwatch.h"
#include "runtime/image/image_output.h"
#include "runtime/render/integrators/features.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/light_learning.h"
#include "runtime/render/training/visible_region.h"
#include "runtime/tools/checkpoint.h"
#include "runtime/tools/exr_options.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/render_files.h"
#include "runtime/tools/render_report.h"
#include "runtime/tools/render_setup.h"
#include "runtime/tools/stored_illumination.h"
#include "runtime/tools/tool.h"
#include "scenes/camera.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_hash.h"

namespace lobe {
namespace {

constexpr const char* kTool = "loberender";

Scene readFor(const RenderJob& job) {
  Progress progress("reading", 1.0);
  Scene scene = readScene(job.scene, {job.definitions, job.lenient, true,
                                      [&](double fraction) { progress.advance(fraction); }, job.camera});
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

/// Whether it is accumulated by a FeatureFilm.
bool isFeature(Aov aov) {
  return aov == Aov::albedo || aov == Aov::normal || aov == Aov::depth;
}

/// Draws the record of --record. If no record serves the surface, prints a warning and the run continues.
void drawRecord(const RenderJob& job, const RenderScene& scene, const Receiver& receiver, TrainedIllumination& training,
                OutputErrors& errors) {
  try {
    const RecordView view = viewRecord(scene, receiver, training, job.training.records);
    errors.attempt(job.recordImage, [&] {
      view.raster.write(job.recordImage);
      printNote(kTool, fmt::format("{}: {}", job.recordImage.string(), view.caption));
    });
  } catch (const NoRecord& e) {
    printWarning(kTool, recordFault(job, e));
  }
  training.particles = {};  // not needed any more; frees memory for rendering
}

/// One run, step by step. Cannot be moved, because members refer to others.
class Run {
 public:
  Run(const RenderJob& job, const StopFlag& stop) : job_(job), stop_(stop) {}
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// Everything before the first new sample. Writes only the plot of a record.
  void prepare();
  /// Renders, with snapshots, until the end or until it is stopped.
  void render();
  /// Writes the outputs, and throws if one of them cannot be written, or if the run was stopped.
  void finish();
  /// Writes the outputs as they are after render() has failed.
  void rescue();

 private:
  void readCheckpoint();
  void readStored(const IlluminationFile& file);
  void readIllumination(const IlluminationFile& file, const std::filesystem::path& path);
  void makeGuiding();
  void encodeTraining(const TrainingPlan& plan);
  void saveTraining();
  RenderOptions options();
  double fractionDone() const;
  bool snapshotIsDue() const;
  void snapshot();
  void writeOutputs(OutputErrors& errors);
  void writePicture(const std::filesystem::path& output, const RunResult& result) const;
  void writeCheckpoint(OutputErrors& errors);
  std::string stopMessage() const;
  double prepared() const { return guiding_.seconds(); }
  const Film& film() const { return gradients_ ? gradients_->pixels() : *film_; }
  ReconstructedImage picture() const;
  void addFeatures();
  Image imageOf(Aov aov) const;

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
  OutputErrors encodingErrors_;  // why one of these is missing
  RunSettings settings_;
  AnyIntegrator integrator_;
  std::optional<Film> film_;
  std::optional<GradientFilm> gradients_;  // replaces film_ with --gradients
  std::optional<FeatureFilm> features_;    // for --aov
  RenderResult result_;
  std::uint64_t sceneHash_ = 0;  // for statistics and the metadata of the picture
  OutputErrors errors_;
  bool checkpointIsWritten_ = false;  // by the last attempt
  Stopwatch sinceSnapshot_;
};

void Run::prepare() {
  if (!job_.resume.empty()) resumed_.emplace(CheckpointFile::open(job_.resume));
  std::optional<IlluminationFile> stored;
  if (!job_.illumination.empty()) stored.emplace(IlluminationFile::open(job_.illumination));
  const Stopwatch reading;
  scene_.emplace(readFor(job_));
  load_.reading = reading.seconds();
  sceneHash_ = pictureHash(*scene_);
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
  renderScene_.emplace(*scene_, job_.connectsThroughSurfaces() ? job_.shadowSurfaces : 0);
  load_.building = building.seconds();
  load_.embree = renderScene_->tracer.buildSeconds();
  camera_.emplace(scene_->camera, scene_->filter);
  const Stopwatch learning;
  const int maxDepth = planOf(job_, *scene_).maxDepth;
  renderScene_->lights.focus(visibleRegion(*renderScene_, *camera_, job_.seed, maxDepth));
  renderScene_->lights.use(learnLightCells(*renderScene_, *camera_, job_.seed, maxDepth));
  guiding_.secondsLights = learning.seconds();
  if (job_.gradients)
    gradients_.emplace(camera_->width(), camera_->height());
  else if (!film_)
    film_.emplace(camera_->width(), camera_->height());
  if (!job_.checkpoint.empty() && film().pixels().size() > kMaxCheckpointPixels)
    throw std::runtime_error(fmt::format("--checkpoint: a checkpoint holds at most {} pixels", kMaxCheckpointPixels));
  if (std::ranges::any_of(job_.aovs, isFeature)) features_.emplace(camera_->width(), camera_->height());
  const std::optional<Receiver> receiver = receiverFor(job_, *renderScene_, *camera_);
  if (job_.guided()) makeGuiding();
  if (receiver) drawRecord(job_, *renderScene_, *receiver, guiding_.training, errors_);
  integrator_ = makeIntegrator(job_, *renderScene_, *camera_, guiding_);
  addFeatures();  // of the samples of the run that this one resumes
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
  restoreChoices(*resumed_, guiding_);
  const bool isComplete = job_.samples && least == static_cast<std::uint32_t>(*job_.samples);
  printNote(kTool, isComplete
                       ? fmt::format("{}: is complete already with --spp {}; a larger number adds samples",
                                     job_.resume.string(), least)
                       : fmt::format("{}: continues with sample {} of each pixel", job_.resume.string(), least + 1));
}

void Run::readStored(const IlluminationFile& file) {
  readIllumination(file, job_.illumination);
  if (job_.integrator == IntegratorKind::bdpt && !job_.trainsFurther())
    printNote(kTool, fmt::format("{}: holds no importance, so light paths are not guided", job_.illumination.string()));
}

void Run::readIllumination(const IlluminationFile& file, const std::filesystem::path& path) {
  const Stopwatch restoring;
  guiding_.training = restoreIllumination(file, path, *scene_);
  if (job_.mayUseProduct() && job_.training.learnFractions && !guiding_.training.report.learntFractions)
    printNote(kTool, fmt::format("{}: the records have learnt no BSDF sampling fractions (trained by guided, or with "
                                 "--bsdf-fraction fixed); all use {:.1f}",
                                 path.string(), kInitialBsdfFraction));
  if (guiding_.training.maxDepth < planOf(job_, *scene_).maxDepth)
    printNote(kTool,
              fmt::format("{}: trained for paths of up to {} segments; its records do not guide the light that only "
                          "longer ones find",
                          path.string(), guiding_.training.maxDepth));
  load_.restoring = restoring.seconds();
}

void Run::makeGuiding() {
  const TrainingPlan plan = planOf(job_, *scene_);
  if (!resumed_ && (job_.illumination.empty() || job_.trainsFurther()))
    train(job_, plan, *renderScene_, *camera_, guiding_);
  encodingErrors_.attempt("the trained illumination", [&] { encodeTraining(plan); });
  guiding_.reduceRecords(job_.reduction);
  guiding_.sampler.emplace(*scene_, guiding_.training.field, guiding_.cachesOrNull());
  guiding_.lightSampler.emplace(*scene_, guiding_.training.importance, nullptr);
}

void Run::encodeTraining(const TrainingPlan& plan) {
  if (!job_.checkpoint.empty() || !job_.saveIllumination.empty())
    illumination_ = encodeIllumination(guiding_.training, plan, *scene_, job_.scene);
  if (!job_.checkpoint.empty() && guiding_.training.importance.records() > 0)
    importance_ =
        encodeIllumination({guiding_.training.importance, guiding_.training.report, {}, {}, guiding_.training.maxDepth},
                           plan, *scene_, job_.scene);
}

/// Writes what a later run would have to train again otherwise. Failures do not prevent rendering.
void Run::saveTraining() {
  if (!job_.saveIllumination.empty())
    errors_.attempt(job_.saveIllumination, [&] {
      if (illumination_.empty()) nameErrors(job_.saveIllumination, [&] { encodingErrors_.throwIfAny(); });
      writeAtomically(job_.saveIllumination, std::span<const std::byte>(illumination_));
    });
  for (const std::string& error : errors_.all()) printWarning(kTool, error + "; rendering goes on");
  OutputErrors ofCheckpoint;  // it is written again later
  writeCheckpoint(ofCheckpoint);
  for (const std::string& error : ofCheckpoint.all()) printWarning(kTool, error);
}

RenderOptions Run::options() {
  RenderOptions options{job_.seed, job_.samples, std::nullopt, job_.sampling, job_.filtering, job_.sampleOffset};
  if (job_.seconds) options.seconds = std::max(*job_.seconds - prepared(), 1e-3);
  if (const double every = job_.snapshotEvery.value_or(RenderJob::kSnapshotSeconds); every > 0)
    options.longestWave = every;
  options.stop = &stop_;
  options.withWave = [this] { addFeatures(); };
  options.onFailure = [this](const RenderResult& result) { result_ = result; };
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
    if (log_->isActive()) log_->add(picture().image, prepared() + result.total.seconds, result.total.samples);
    if (snapshotIsDue()) snapshot();
  };
  result_ = std::visit(
      [&]<class AnIntegrator>(const std::unique_ptr<AnIntegrator>& integrator) {
        if constexpr (std::is_same_v<AnIntegrator, GradientIntegrator> ||
                      std::is_same_v<AnIntegrator, BidirectionalGradientIntegrator>)
          return lobe::render(*camera_, *integrator, *gradients_, options(), afterWave, result_);
        else
          return lobe::render(*camera_, *integrator, *film_, options(), afterWave, result_);
      },
      integrator_);
}

ReconstructedImage Run::picture() const {
  return gradients_ ? gradients_->reconstruct(*job_.gradients) : ReconstructedImage{film_->mean(), 0};
}

void Run::addFeatures() {
  if (features_) features_->addMissing(film(), *renderScene_, *camera_, options());
}

Image Run::imageOf(Aov aov) const {
  if (aov == Aov::albedo) return features_->albedo();
  if (aov == Aov::normal) return features_->normal();
  if (aov == Aov::depth) return features_->depth();
  return aov == Aov::variance ? film().varianceOfMean() : film().counts();
}

void Run::writeOutputs(OutputErrors& errors) {
  const RunResult result{result_, guiding_, film()};
  for (const auto& output : job_.outputs) errors.attempt(output, [&] { writePicture(output, result); });
  writeCheckpoint(errors);
  errors.attempt(job_.convergence, [&] { log_->write(); });
  // Last, because the JSON library ends the program if it runs out of memory while it frees an object.
  if (!job_.stats.empty())
    errors.attempt(job_.stats,
                   [&] { writeAtomically(job_.stats, jsonText(statistics(job_, sceneHash_, load_, result)) + "\n"); });
}

void Run::writePicture(const std::filesystem::path& output, const RunResult& result) const {
  const ReconstructedImage written = picture();
  ImageAttributes all = attributes(job_, sceneHash_, result);
  if (gradients_) all["clampedFraction"] = written.clampedFraction;
  Aovs aovs;
  for (const Aov aov : job_.aovs)
    if (features_ || !isFeature(aov)) aovs.emplace(aov, imageOf(aov));
  noteClamped(kTool, output, writeImage(output, written.image, all, layersOf(aovs), job_.exr), job_.exr);
}

void Run::writeCheckpoint(OutputErrors& errors) {
  if (job_.checkpoint.empty()) return;
  checkpointIsWritten_ = errors.attempt(job_.checkpoint, [&] {
    const std::vector<std::byte> bytes = nameErrors(job_.checkpoint, [&] {
      encodingErrors_.throwIfAny();
      return encodeCheckpoint(settings_, film(), result_, guiding_, illumination_, importance_);
    });
    writeAtomically(job_.checkpoint, std::span<const std::byte>(bytes));
  });
}

std::string Run::stopMessage() const {
  const auto [least, most] = film().sampleRange();
  std::string message = least == most ? fmt::format("{}", least) : fmt::format("{} to {}", least, most);
  if (job_.samples) message += fmt::format(" of {}", *job_.samples);
  message += " samples per pixel";
  if (most == 0)
    message += ", so no picture is written";
  else
    message += errors_.all().empty() ? " are rendered and written" : " are rendered, but not all outputs are written";
  if (least == 0 && most > 0) message += "; pixels without a sample are black";
  if (checkpointIsWritten_) message += fmt::format("; --resume {} goes on", shellQuoted(job_.checkpoint.string()));
  return message;
}

void Run::finish() {
  if (const std::uint64_t dropped = film().dropped(); dropped > 0)
    printWarning(kTool, fmt::format("{} samples were negative or not finite, and were discarded", dropped));
  if (film().sampleRange().second > 0)
    writeOutputs(errors_);
  else
    writeCheckpoint(errors_);
  if (result_.stopped && errors_.all().empty()) throw Stopped(stopMessage());
  if (result_.stopped) printWarning(kTool, "interrupted: " + stopMessage());
  errors_.throwIfAny();
}

void Run::rescue() {
  if (film().sampleRange().second == 0) return;
  printWarning(kTool, "rendering has failed; the outputs are written as they are");
  try {
    addFeatures();
  } catch (const std::exception&) {
    features_.reset();  // rather no AOVs than those of fewer samples than the picture has
  }
  writeOutputs(errors_);
  for (const std::string& error : errors_.all()) printWarning(kTool, error);
}

}  // namespace

void run(const RenderJob& job, const StopFlag& stop) {
  job.validate();
  checkFiles(job);
  Run run(job, stop);
  stoppable(stop, "before rendering, so no picture is written", [&] { run.prepare(); });
  try {
    run.render();
  } catch (const std::exception&) {
    run.rescue();
    throw;
  }
  run.finish();
}

}  // namespace lobe
