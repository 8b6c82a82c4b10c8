#include "runtime/render/training.h"

#include <chrono>
#include <stdexcept>

namespace lobe {

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

TrainedIllumination trainIllumination(const RenderScene& scene, const RayCamera& camera, const BrdfCaches* caches,
                                      const TrainingPlan& plan, const std::function<void(int)>& afterPass) {
  using Clock = std::chrono::steady_clock;
  plan.validate();
  const Clock::time_point start = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };

  if (scene.tracer.bounds().isEmpty() || scene.lights.empty()) return {};
  IlluminationTrainer trainer(plan.records, scene.tracer.bounds().diagonal().norm());
  const GuidedSampler sampler(scene.scene, trainer.cache(), caches);
  std::optional<EnvironmentGuide> guide;
  if (scene.lights.environmentProbability() > 0) guide.emplace(scene.lights);
  const ParticleTracer tracer(scene, camera, sampler, guide ? &*guide : nullptr, plan.seed);

  TrainingReport report;
  std::vector<Particle> particles;
  while (report.passes < plan.passes && (report.passes == 0 || seconds() < plan.seconds)) {
    const ImportonResult importons = tracer.traceImportons(report.passes, plan.importons);
    if (guide) {
      for (const EnvironmentUse& use : importons.uses) guide->learn(use.point, use.wi, use.weight);
      guide->update();
    }
    particles = tracer.tracePhotons(report.passes, plan.photons);
    report.particles += particles.size();
    trainer.learn(particles, importons.requests);
    ++report.passes;
    if (afterPass) afterPass(report.passes);
  }
  // Radii have shrunk since the last requests were made: a last look closes the gaps.
  trainer.fill(particles, tracer.traceImportons(report.passes, plan.importons).requests);
  report.seconds = seconds();
  report.undersampledShare = trainer.undersampledShare();
  return {trainer.cache(), report};
}

}  // namespace lobe
