#include "runtime/render/training.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <stdexcept>

#include <oneapi/tbb/parallel_invoke.h>

namespace lobe {
namespace {

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

/// Importance only steers photons: half the components and neighbours do (measured by lobebench-illumination).
TrainingOptions importanceOptions(TrainingOptions options) {
  options.components = std::max(1, options.components / 2);
  options.neighbours = std::max(1, options.neighbours / 2);
  return options;
}

/// One training run. Importons are guided by the light learnt in the passes before, photons by the importance that
/// importons have brought.
class Training {
 public:
  Training(const RenderScene& scene, const RayCamera& camera, const BrdfCaches* caches, const TrainingPlan& plan)
      : plan_(plan),
        radiance_(plan.records, scene.tracer.bounds().diagonal().norm()),
        importance_(importanceOptions(plan.records), scene.tracer.bounds().diagonal().norm()),
        radianceSampler_(scene.scene, radiance_.cache(), caches),
        importanceSampler_(scene.scene, importance_.cache(), nullptr) {
    const bool tracesPhotons = plan.from != TrainFrom::paths;
    if (tracesPhotons && scene.lights.environmentProbability() > 0) guide_.emplace(scene.lights);
    wishes_ = {guide_.has_value(), tracesPhotons, plan.from != TrainFrom::photons};
    tracer_.emplace(scene, camera, radianceSampler_, importanceSampler_, guide_ ? &*guide_ : nullptr, plan.seed);
  }
  // Tracer and samplers refer to the other members.
  Training(const Training&) = delete;
  Training& operator=(const Training&) = delete;

  PassReport runPass(int pass) {
    const Stopwatch watch;
    ImportonResult importons = tracer_->traceImportons(pass, plan_.importons, wishes_);
    if (guide_) {
      for (const EnvironmentUse& use : importons.uses) guide_->learn(use.point, use.wi, use.weight);
      guide_->update();
    }
    samples_ = std::move(importons.samples);
    PhotonResult photons;
    if (wishes_.importance) photons = tracer_->tracePhotons(pass, plan_.photons);
    photons_ = std::move(photons.particles);
    PassReport report{0, photons_.size() + samples_.size(), 0, std::nullopt};
    // Side by side: what one has to do in order leaves room for the other.
    oneapi::tbb::parallel_invoke(
        [&] { importance_.learn(std::array{std::span<const Particle>(importons.importance)}, photons.requests); },
        [&] { report.logLikelihood = radiance_.learn(sources(), importons.requests); });
    report.records = radiance_.cache().size();
    report.seconds = watch.seconds();
    return report;
  }

  /// Radii have shrunk since the last requests were made: a last look closes the gaps.
  void finish(int passes) { radiance_.fill(sources(), tracer_->traceImportons(passes, plan_.importons, {}).requests); }

  const IlluminationTrainer& radiance() const { return radiance_; }
  std::array<std::vector<Particle>, 2> takeParticles() { return {std::move(photons_), std::move(samples_)}; }

 private:
  std::array<std::span<const Particle>, 2> sources() const { return {photons_, samples_}; }

  const TrainingPlan& plan_;
  IlluminationTrainer radiance_, importance_;
  GuidedSampler radianceSampler_, importanceSampler_;
  std::optional<EnvironmentGuide> guide_;
  ImportonWishes wishes_;
  std::optional<ParticleTracer> tracer_;
  std::vector<Particle> photons_, samples_;  // of the last pass
};

}  // namespace

std::map<std::string, TrainFrom> trainFromNames() {
  return {{"photons", TrainFrom::photons}, {"paths", TrainFrom::paths}, {"both", TrainFrom::both}};
}

void TrainingPlan::validate() const {
  const auto require = [](bool condition, const char* message) {
    if (!condition) throw std::runtime_error(message);
  };
  require(passes >= 1, "training passes: at least 1");
  require(photons >= 1, "training photons: at least 1");
  require(importons >= 1, "training importons: at least 1");
  require(seconds > 0, "training seconds: over 0");
  records.validate();
}

std::uint64_t TrainingReport::particles() const {
  std::uint64_t sum = 0;
  for (const PassReport& pass : passes) sum += pass.particles;
  return sum;
}

TrainedIllumination trainIllumination(const RenderScene& scene, const RayCamera& camera, const BrdfCaches* caches,
                                      const TrainingPlan& plan, const std::function<void(const PassReport&)>& afterPass) {
  plan.validate();
  if (scene.tracer.bounds().isEmpty() || scene.lights.empty()) return {};
  const Stopwatch watch;
  Training training(scene, camera, caches, plan);
  TrainingReport report;
  int passes = 0;
  while (passes < plan.passes && (passes == 0 || watch.seconds() < plan.seconds)) {
    report.passes.push_back(training.runPass(passes));
    ++passes;
    if (afterPass) afterPass(report.passes.back());
  }
  training.finish(passes);
  report.seconds = watch.seconds();
  report.undersampledShare = training.radiance().undersampledShare();
  TrainedIllumination trained{training.radiance().cache(), report, {}};
  if (plan.keepParticles) trained.particles = training.takeParticles();
  return trained;
}

}  // namespace lobe
