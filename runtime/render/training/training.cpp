#include "runtime/render/training/training.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "runtime/core/parallel.h"
#include "runtime/core/stopwatch.h"

namespace lobe {
namespace {

/// Importance only guides photons; half the components and neighbours suffice (measured by lobebench-illumination), and
/// it is no longer needed when records are fitted once more.
FieldOptions importanceOptions(FieldOptions options) {
  options.components = std::max(1, options.components / 2);
  options.neighbours = std::max(1, options.neighbours / 2);
  options.reservoir = 0;
  return options;
}

/// The fraction of the plan's particles that each pass traces: 1 without a time limit. With a limit, passes start small
/// and double in size, so that even a short training has several passes, and no pass begins that would end long after
/// the limit.
class PassSizes {
 public:
  explicit PassSizes(const TrainingPlan& plan) : limit_(plan.seconds), next_(limit_ < kInfinity ? firstOf(plan) : 1) {}

  void setLimit(double seconds) { limit_ = seconds; }

  /// The fraction for the next pass, in (0, 1]; nullopt if it would not end in time. The first pass always runs.
  std::optional<double> next() const {
    if (taken_ == 0 || limit_ == kInfinity) return next_;
    const double left = limit_ - watch_.seconds();
    const double fitting = std::min(next_, last_ * left / taken_);
    // A pass smaller than the one before improves the records less than rendering for the same time would improve the
    // image.
    return fitting >= std::min(last_, next_) ? std::optional(fitting) : std::nullopt;
  }

  double last() const { return last_; }

  void passDone(double size, double seconds) {
    last_ = size;
    taken_ = seconds;
    next_ = std::min(1.0, 2 * size);
  }

 private:
  static double firstOf(const TrainingPlan& plan) {
    constexpr double kFirstParticles = 25000;  // 0.2 s in the kitchen scene
    return std::min(1.0, kFirstParticles / (static_cast<double>(plan.photons) + plan.importons));
  }

  double limit_, next_;
  double last_ = 0, taken_ = 0;  // size and seconds of the last pass
  Stopwatch watch_;
};

/// One training run. Importons are guided by the radiance learnt in previous passes, photons by the importance learnt
/// from importons.
class Training {
 public:
  Training(const RenderScene& scene, const RayCamera& camera, const LobeCacheSet* caches, const TrainingPlan& plan,
           const Field& earlier)
      : plan_(plan),
        radiance_(inScene(plan.records, scene), earlier),
        importance_(importanceOptions(inScene(plan.records, scene))),
        radianceSampler_(scene.scene, radiance_, caches),
        importanceSampler_(scene.scene, importance_, nullptr) {
    const bool tracesPhotons = plan.from != TrainFrom::paths;
    if (tracesPhotons && scene.lights.environmentProbability() > 0) guide_.emplace(scene.lights);
    wishes_ = {guide_.has_value(), tracesPhotons, plan.from != TrainFrom::photons,
               plan.learnFractions && caches != nullptr};
    tracer_.emplace(scene, camera, radianceSampler_, importanceSampler_, guide_ ? &*guide_ : nullptr, plan.seed,
                    plan.maxDepth);
  }
  // Tracer and samplers refer to the other members.
  Training(const Training&) = delete;
  Training& operator=(const Training&) = delete;

  /// size: fraction of the plan's particles, see PassSizes.
  PassReport runPass(int pass, double size) {
    const Stopwatch watch;
    ImportonResult importons = tracer_->traceImportons(pass, fractionOf(plan_.importons, size), wishes_);
    if (guide_) {
      for (const EnvironmentUse& use : importons.uses) guide_->learn(use.point, use.wi, use.weight);
      guide_->update();
    }
    PhotonResult photons;
    if (wishes_.importance) photons = tracer_->tracePhotons(pass, fractionOf(plan_.photons, size));
    SampleStorage before = std::exchange(samples_, std::move(importons.radiance));
    samples_.merge(std::move(photons.radiance));
    importons.importance.merge(std::move(photons.importance));
    PassReport report{0, samples_.particles(), 0, std::nullopt};
    // The updates run in parallel, because each has parts that leave threads idle. Releasing memory takes time too.
    parallelInvoke([&] { importance_.update(importons.importance); },
                   [&] { report.logLikelihood = radiance_.update(samples_); }, [&] { before.clear(); });
    report.records = radiance_.records();
    report.seconds = watch.seconds();
    return report;
  }

  /// Fits the records to the particles of all passes, and fills the gaps between records whose radii have shrunk since
  /// the last requests.
  void finish(int passes, double size) {
    radiance_.refit();
    radiance_.fill(tracer_->traceImportons(passes, fractionOf(plan_.importons, size), {}).radiance, samples_);
  }

  const Field& radiance() const { return radiance_; }
  const Field& importance() const { return importance_; }
  SampleStorage takeParticles() { return std::move(samples_); }

 private:
  static int fractionOf(int count, double size) { return std::max(1, static_cast<int>(std::lround(size * count))); }
  static FieldOptions inScene(FieldOptions options, const RenderScene& scene) {
    options.sceneDiagonal = scene.lights.region().diagonal();
    return options;
  }

  const TrainingPlan& plan_;
  Field radiance_, importance_;
  GuidedSampler radianceSampler_, importanceSampler_;
  std::optional<EnvironmentGuide> guide_;
  ImportonWishes wishes_;
  std::optional<ParticleTracer> tracer_;
  SampleStorage samples_;  // of the last pass
};

/// Runs passes, after those that the report has, up to the number of the plan or as long as `sizes` allows.
void runPasses(Training& training, const TrainingPlan& plan, PassSizes& sizes, TrainingReport& report,
               const std::function<void(const PassReport&)>& afterPass) {
  for (int pass = static_cast<int>(report.passes.size()); pass < plan.passes; ++pass) {
    const std::optional<double> size = sizes.next();
    if (!size) break;
    report.passes.push_back(training.runPass(pass, *size));
    sizes.passDone(*size, report.passes.back().seconds);
    if (afterPass) afterPass(report.passes.back());
  }
}

}  // namespace

std::map<std::string, TrainFrom> trainFromNames() {
  return {{"photons", TrainFrom::photons}, {"paths", TrainFrom::paths}, {"both", TrainFrom::both}};
}

void TrainingPlan::validate() const {
  const auto require = [](bool condition, const char* message) {
    if (!condition) throw std::runtime_error(message);
  };
  require(passes >= 1, "training passes: must be at least 1");
  require(photons >= 1 && photons <= kMostParticles, "training photons: must be between 1 and 100000000");
  require(importons >= 1 && importons <= kMostParticles, "training importons: must be between 1 and 100000000");
  require(seconds > 0, "training seconds: must be positive");
  records.validate();
}

std::uint64_t TrainingReport::particles() const {
  std::uint64_t sum = 0;
  for (const PassReport& pass : passes) sum += pass.particles;
  return sum;
}

TrainedIllumination trainIllumination(const RenderScene& scene, const RayCamera& camera, const LobeCacheSet* caches,
                                      const TrainingPlan& plan, const std::function<void(const PassReport&)>& afterPass,
                                      const Field& earlier, const ExtendTraining& extend) {
  plan.validate();
  if (scene.tracer.bounds().isEmpty() || scene.lights.empty()) return {};
  const Stopwatch watch;
  Training training(scene, camera, caches, plan, earlier);
  TrainingReport report;
  PassSizes sizes(plan);
  runPasses(training, plan, sizes, report, afterPass);
  double deciding = 0;
  while (extend && std::ssize(report.passes) < plan.passes) {
    const double before = watch.seconds();
    const std::optional<double> limit = extend(training.radiance());
    deciding += watch.seconds() - before;
    if (!limit) break;
    sizes.setLimit(*limit + deciding);
    runPasses(training, plan, sizes, report, afterPass);
  }
  training.finish(static_cast<int>(report.passes.size()), sizes.last());
  report.seconds = watch.seconds() - deciding;
  report.undersampledFraction = training.radiance().undersampledFraction();
  report.learntFractions = plan.learnFractions && caches != nullptr;
  TrainedIllumination trained{training.radiance().frozen(), report, {}, {}, plan.maxDepth};
  if (plan.keepImportance) trained.importance = training.importance().frozen();
  if (plan.keepParticles) trained.particles = training.takeParticles();
  return trained;
}

}  // namespace lobe
