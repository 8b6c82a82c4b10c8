#include "runtime/tools/render_setup.h"

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/core/stopwatch.h"
#include "runtime/render/integrators/learn_sample_counts.h"
#include "runtime/tools/tool.h"
#include "scenes/scene_hash.h"

namespace lobe {
namespace {

// Fraction of --seconds. In the kitchen at 60 seconds, samples have the same variance after 11 seconds of training as
// after 21 seconds.
constexpr double kTrainingFraction = 0.15;

/// Fraction of --seconds after which automatic compares path and product.
constexpr double kTrialFraction = 0.03;

/// Seconds below which automatic only uses product if it is clearly better early in training: at 8 seconds, training on
/// and comparing again left little more than half of the time for the picture in living-room-2.
constexpr double kBrief = 30;

/// Whether automatic compares path and product during training. With limits that are given, or if the illumination is
/// saved for other runs, all of it is trained.
bool comparesDuringTraining(const RenderJob& job) {
  return job.integrator == IntegratorKind::automatic && job.seconds && !job.trainSeconds && !job.passes &&
         job.saveIllumination.empty();
}

/// The fraction of a full-sized pilot, and of the paths for learning counts, so that both take a few percent of the
/// time of a short run. With --spp it does not depend on the number of samples, so that parts of a picture
/// (--sample-offset) use the same counts and the same integrator.
double preparationSize(const RenderJob& job) {
  constexpr double kLeast = 0.2, kSeconds = 10;
  return job.seconds ? std::clamp(*job.seconds / kSeconds, kLeast, 1.0) : 1.0;
}

/// size: the fraction of the paths of a full learning.
SampleCountModel learnCounts(const RenderJob& job, const RenderScene& scene, const RayCamera& camera,
                             const PathOptions& options, const GuidedSampler& sampler, std::size_t records,
                             double size) {
  constexpr double kPaths = 100000;
  return learnSampleCounts(scene, camera, options, sampler, records, static_cast<int>(kPaths * size), job.seed);
}

bool usesCounts(const RenderJob& job) {
  return job.russianRoulette == RussianRoulette::efficiency && !job.gradients;
}

PathOptions pathOptions(const RenderJob& job, const Scene& scene) {
  PathOptions options;
  if (const std::optional<int> depth = job.maxDepth ? job.maxDepth : scene.maxDepth) options.maxDepth = *depth;
  options.emitterVisibility = scene.emitterVisibility;
  if (job.fireflyLimit) options.fireflyLimit = *job.fireflyLimit;
  return options;
}

/// Guided path tracing with light paths; null if they do not pay.
std::unique_ptr<BidirectionalIntegrator> makeWithLightPaths(const RenderJob& job, const RenderScene& scene,
                                                            const RayCamera& camera, const PathOptions& options,
                                                            Guiding& guiding) {
  // The inefficiency must fall to this fraction: most pixels have no outliers and lose the time of the light paths, and
  // the trial does not see outliers that light paths cannot find. In the kitchenette, where it falls to 0.43 of its
  // value in the trial, light paths gain nothing.
  constexpr double kGain = 0.25;
  constexpr double kPaths = 50000;  // with 10,000, one of three trials in the kitchen missed its outliers
  if (!job.mayUseLightPaths() || job.lightPaths == LightPathUse::off || scene.lights.empty()) return nullptr;
  const Stopwatch watch;
  const int paths = static_cast<int>(kPaths * preparationSize(job));
  if (scene.lights.environmentProbability() > 0)
    guiding.environmentGuide.emplace(learnEnvironmentGuide(scene, camera, options, *guiding.sampler, paths, job.seed));
  const PhotonEmission emission(scene.lights, guiding.environmentGuide ? &*guiding.environmentGuide : nullptr);
  if (!guiding.lightPaths) {
    guiding.lightPaths = tryLightPaths(scene, camera, options, *guiding.sampler, emission, paths, job.seed);
    guiding.secondsLightPaths = watch.seconds();
  }
  const LightPathTrial& trial = *guiding.lightPaths;
  guiding.usesLightPaths =
      job.lightPaths == LightPathUse::on || trial.inefficiencyWithLight() < kGain * trial.inefficiency();
  if (!guiding.usesLightPaths) return nullptr;
  return std::make_unique<GuidedLightIntegrator>(scene, camera, options, *guiding.sampler,
                                                 LightTracing{trial.pathsPerPixel, emission});
}

/// Compares path and product with this sampler, to set guiding.pilot.
Pilot runPilot(const RenderJob& job, const RayCamera& camera, const Integrator& path, const Integrator& guided) {
  const Stopwatch watch;
  PilotOptions pilot;
  pilot.tiles = static_cast<int>(pilot.tiles * preparationSize(job));
  pilot.seed = job.seed;
  // The same picture for a seed is only promised for --spp.
  pilot.timed = job.seconds.has_value();
  const auto results = comparePilots(camera, std::array<const Integrator*, 2>{&path, &guided}, pilot);
  return Pilot{compared(results[0], results[1], job.seconds && *job.seconds < kBrief), watch.seconds()};
}

/// Compares path and product with what has been learnt so far in training.
Pilot runPilotEarly(const RenderJob& job, const RenderScene& scene, const RayCamera& camera, const Field& field,
                    const Guiding& guiding) {
  constexpr double kCountsSize = 0.25;
  const Stopwatch watch;
  const GuidedSampler sampler(scene.scene, field, guiding.cachesOrNull());
  PathOptions options = pathOptions(job, scene.scene);
  const PathIntegrator path(scene, options);
  std::optional<SampleCountModel> counts;
  if (usesCounts(job)) {
    counts = learnCounts(job, scene, camera, options, sampler, field.records(), kCountsSize * preparationSize(job));
    options.counts = &*counts;
  }
  Pilot pilot = runPilot(job, camera, path, GuidedIntegrator(scene, options, sampler));
  pilot.seconds = watch.seconds();
  return pilot;
}

/// Decides for automatic, by a comparison early in training, whether to train further. If product is clearly better,
/// more training pays. If it may become better, the comparison is made again after training. Otherwise more training
/// would be lost time.
ExtendTraining extendIfProductPays(const RenderJob& job, const RenderScene& scene, const RayCamera& camera,
                                   Guiding& guiding) {
  return [&](const Field& field) -> std::optional<double> {
    if (guiding.pilot) return std::nullopt;
    guiding.pilot = runPilotEarly(job, scene, camera, field, guiding);
    guiding.pilot->provisional = guiding.pilot->isUndecided();
    return guiding.prefersPath() ? std::nullopt : std::optional(kTrainingFraction * *job.seconds);
  };
}

/// path, guided or product.
AnyIntegrator makeUnidirectional(const RenderJob& job, const RenderScene& scene, const RayCamera& camera,
                                 Guiding& guiding) {
  PathOptions options = pathOptions(job, scene.scene);
  if (!guiding.sampler || guiding.prefersPath()) return std::make_unique<PathIntegrator>(scene, options);
  if (usesCounts(job)) {
    const Stopwatch watch;
    guiding.counts = learnCounts(job, scene, camera, options, *guiding.sampler, guiding.training.field.records(),
                                 preparationSize(job));
    guiding.secondsCounts = watch.seconds();
  }
  const PathOptions optionsOfPath = options;
  if (guiding.counts) options.counts = &*guiding.counts;
  auto guided = std::make_unique<GuidedIntegrator>(scene, options, *guiding.sampler);
  if (job.integrator == IntegratorKind::automatic && (!guiding.pilot || guiding.pilot->provisional)) {
    auto path = std::make_unique<PathIntegrator>(scene, optionsOfPath);
    const double earlier = guiding.pilot ? guiding.pilot->seconds : 0;
    guiding.pilot = runPilot(job, camera, *path, *guided);
    guiding.pilot->seconds += earlier;
    if (guiding.prefersPath()) return path;
  }
  if (auto withLightPaths = makeWithLightPaths(job, scene, camera, options, guiding)) return withLightPaths;
  return guided;
}

/// With the sampler of the integrator, which has been chosen if it was to be.
std::unique_ptr<GradientIntegrator> makeGradients(const RenderJob& job, const RenderScene& scene,
                                                  const RayCamera& camera, const Guiding& guiding) {
  const PathOptions options = pathOptions(job, scene.scene);
  if (!guiding.sampler || guiding.prefersPath()) return std::make_unique<PathGradients>(scene, camera, options);
  return std::make_unique<GuidedGradients>(scene, camera, options, *guiding.sampler);
}

std::unique_ptr<BidirectionalIntegrator> makeBdpt(const RenderJob& job, const RenderScene& scene,
                                                  const RayCamera& camera, const Guiding& guiding) {
  const PathOptions options = pathOptions(job, scene.scene);
  if (!guiding.sampler) return std::make_unique<BdptIntegrator>(scene, camera, options);
  return std::make_unique<GuidedBdptIntegrator>(scene, camera, options, *guiding.sampler, *guiding.lightSampler);
}

std::unique_ptr<BidirectionalGradientIntegrator> makeBdptGradients(const RenderJob& job, const RenderScene& scene,
                                                                   const RayCamera& camera, const Guiding& guiding) {
  const PathOptions options = pathOptions(job, scene.scene);
  if (!guiding.sampler) return std::make_unique<BdptGradients>(scene, camera, options);
  return std::make_unique<GuidedBdptGradients>(scene, camera, options, *guiding.sampler, *guiding.lightSampler);
}

std::unique_ptr<BidirectionalIntegrator> makeVcm(const RenderJob& job, const RenderScene& scene,
                                                 const RayCamera& camera) {
  const MergeRadius radius{job.merge.first * scene.lights.region().diagonal(), job.merge.alpha};
  return std::make_unique<VcmIntegrator>(scene, camera, pathOptions(job, scene.scene), radius);
}

}  // namespace

TrainingPlan planOf(const RenderJob& job, const Scene& scene) {
  TrainingPlan plan = job.training;
  plan.seed = job.seed;
  plan.maxDepth = pathOptions(job, scene).maxDepth;
  plan.keepParticles = job.record.has_value();
  plan.keepImportance = job.integrator == IntegratorKind::bdpt;
  plan.seconds = job.trainSeconds.value_or(job.seconds ? kTrainingFraction * *job.seconds : kInfinity);
  // If the time is limited and --passes is not given, only the time limits the number of passes.
  plan.passes = job.passes.value_or(plan.seconds < kInfinity ? std::numeric_limits<int>::max() : plan.passes);
  return plan;
}

void train(const RenderJob& job, const TrainingPlan& plan, const RenderScene& scene, const RayCamera& camera,
           Guiding& guiding) {
  const bool timed = plan.seconds < kInfinity;
  Progress progress("training", timed ? plan.seconds : plan.passes);
  const TrainedIllumination earlier = std::move(guiding.training);
  const bool early = comparesDuringTraining(job);
  TrainingPlan start = plan;
  if (early) start.seconds = kTrialFraction * *job.seconds;
  guiding.training = trainIllumination(
      scene, camera, guiding.cachesOrNull(), start,
      [&](const PassReport& pass) { progress.advance(timed ? pass.seconds : 1.0); }, earlier.field,
      early ? extendIfProductPays(job, scene, camera, guiding) : ExtendTraining());
  if (earlier.field.records() == 0) return;
  if (!earlier.report.learntFractions) guiding.training.report.learntFractions = false;
  guiding.training.maxDepth = std::min(guiding.training.maxDepth, earlier.maxDepth);
}

RunSettings settingsOf(const RenderJob& job, const Scene& scene, const Guiding& guiding,
                       const std::optional<IlluminationFile>& stored) {
  const FilmCrop picture = scene.camera.picture();
  RunSettings all{{"the version of Lobe", LOBE_VERSION},
                  {"--integrator", nameOf(job.integrator)},
                  {"the size", fmt::format("{}x{}", picture.width, picture.height)},
                  {"--seed", std::to_string(job.seed)},
                  {"--sampler", job.sampling == PixelSampling::sobol ? "sobol" : "independent"},
                  {"--filtering", job.filtering == PixelFiltering::splatting ? "splatting" : "importance"},
                  {"--sample-offset", std::to_string(job.sampleOffset)},
                  {"--max-depth", job.maxDepth ? std::to_string(*job.maxDepth) : "that of the scene"},
                  {"--shadow-surfaces", std::to_string(job.shadowSurfaces)},
                  {"--firefly-limit", job.fireflyLimit ? fmt::format("{}", *job.fireflyLimit) : "none"},
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
  if (job.mayUseLightPaths()) all.emplace_back("--light-paths", nameOf(job.lightPaths));
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

AnyIntegrator makeIntegrator(const RenderJob& job, const RenderScene& scene, const RayCamera& camera,
                             Guiding& guiding) {
  if (job.integrator == IntegratorKind::bdpt && job.gradients) return makeBdptGradients(job, scene, camera, guiding);
  if (job.integrator == IntegratorKind::bdpt) return makeBdpt(job, scene, camera, guiding);
  if (job.integrator == IntegratorKind::vcm) return makeVcm(job, scene, camera);
  AnyIntegrator integrator = makeUnidirectional(job, scene, camera, guiding);
  if (job.gradients) return makeGradients(job, scene, camera, guiding);
  return integrator;
}

}  // namespace lobe
