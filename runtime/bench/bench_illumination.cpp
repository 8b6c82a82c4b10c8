// lobebench-illumination: quality of trained illumination for several numbers of passes: the log-likelihood of held-out
// particles, and the relative variance (NEV) of the mixtures with respect to the incident-radiance reference at points
// on camera paths.

#include <algorithm>
#include <cmath>
#include <ctime>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "runtime/analysis/incident_radiance.h"
#include "runtime/bench/bench_training.h"
#include "runtime/core/parallel.h"
#include "runtime/core/statistics.h"
#include "runtime/guiding/field_data.h"
#include "runtime/guiding/sample_storage_data.h"
#include "runtime/render/training/visible_region.h"
#include "runtime/tools/json_text.h"

namespace {

using namespace lobe;

// Seed of held-out photons, receivers and the incident-radiance reference, different from that of training.
constexpr std::uint64_t kHeldOutSeed = 1000003;

struct Options : BenchTraining {
  std::vector<TrainFrom> sources{TrainFrom::both};
  std::vector<int> passes{1, 2, 4, 8, 16};
  int receivers = 200;
  int heldOutPhotons = 2000000;
};

/// CPU time of all threads, which other processes do not affect.
double processorSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// A trained illumination with its source of samples, number of passes and CPU time.
struct Trained {
  TrainFrom from;
  int passes;
  double seconds;
  TrainedIllumination illumination;
};

/// The data on which all trainings are graded.
struct HeldOut {
  std::vector<Receiver> receivers;
  std::vector<std::vector<Particle>> particles;  ///< held-out particles around each receiver
  std::vector<IncidentRadiance> light;           ///< incident-radiance reference at each receiver
};

/// Photons of a different seed. Emission from the environment is guided by importons, but scattering is not guided.
std::vector<Particle> heldOutParticles(const RenderScene& scene, const RayCamera& camera, const Options& o) {
  const Field nothing;
  const GuidedSampler sampler(scene.scene, nothing, nullptr);
  std::optional<EnvironmentGuide> guide;
  if (scene.lights.environmentProbability() > 0) guide.emplace(scene.lights);
  const ParticleTracer tracer(scene, camera, sampler, sampler, guide ? &*guide : nullptr, kHeldOutSeed);
  if (guide) {
    for (const EnvironmentUse& use : tracer.traceImportons(0, 8 * o.plan.importons, {.uses = true}).uses)
      guide->learn(use.point, use.wi, use.weight);
    guide->update();
  }
  return dataOf(tracer.tracePhotons(0, o.heldOutPhotons).radiance).photons;
}

HeldOut makeHeldOut(const RenderScene& scene, const RayCamera& camera, const Options& o, const Field& best) {
  HeldOut heldOut;
  heldOut.receivers = receiversOfPaths(scene, camera, o.receivers, kHeldOutSeed);
  const std::vector<Particle> particles = heldOutParticles(scene, camera, o);
  const float reach = o.plan.records.unitFraction * scene.lights.region().diagonal();
  const std::size_t count = heldOut.receivers.size();
  heldOut.particles.resize(count);
  heldOut.light.assign(count, IncidentRadiance({}));
  // Guided paths, because light that was scattered before it passed through panes causes fireflies with other paths.
  const GuidedSampler sampler(scene.scene, best, nullptr);
  const GuidedIntegrator paths(scene, {}, sampler);
  parallelFor(std::size_t{0}, count, [&](std::size_t i) {
    const Receiver& receiver = heldOut.receivers[i];
    heldOut.particles[i] =
        particlesAround(receiver, particles, static_cast<std::size_t>(o.plan.records.neighbours), reach);
    IncidentRadianceOptions options;
    options.seed = kHeldOutSeed;
    heldOut.light[i] = IncidentRadiance(scene, paths, receiver, ServedDensity(cacheOf(best), receiver), options, i);
  });
  return heldOut;
}

/// Statistics of values that spread over magnitudes: the median, the 90th percentile, and the geometric mean of 1 + NEV
/// minus 1, which no single receiver dominates.
nlohmann::ordered_json summary(std::vector<double> nevs) {
  if (nevs.empty()) return nullptr;
  std::ranges::sort(nevs);
  double logs = 0;
  for (const double nev : nevs) logs += std::log(std::max(1 + nev, 1e-3));
  const auto count = static_cast<double>(nevs.size());
  return {{"median", quantile(nevs, 0.5)}, {"p90", quantile(nevs, 0.9)}, {"mean", std::exp(logs / count) - 1}};
}

nlohmann::ordered_json grade(const HeldOut& heldOut, const IlluminationCache& cache) {
  std::vector<double> mixture, defensive;
  double logs = 0;
  int withParticles = 0, served = 0;
  for (std::size_t i = 0; i < heldOut.receivers.size(); ++i) {
    const ServedDensity density(cache, heldOut.receivers[i]);
    const auto mixturePdf = [&](const Vec3& wi) { return density.mixture(wi); };
    served += density.record() != nullptr;
    if (const auto mean = meanLogDensity(heldOut.particles[i], mixturePdf)) {
      logs += *mean;
      ++withParticles;
    }
    if (const auto nev = heldOut.light[i].nev(mixturePdf)) mixture.push_back(*nev);
    if (const auto nev = heldOut.light[i].nev([&](const Vec3& wi) { return density.defensive(wi); }))
      defensive.push_back(*nev);
  }
  const auto count = static_cast<double>(heldOut.receivers.size());
  return {{"log_likelihood", logs / std::max(1, withParticles)},
          {"nev", summary(mixture)},
          {"nev_defensive", summary(defensive)},
          {"served_fraction", served / count},
          {"lit_fraction", static_cast<double>(mixture.size()) / count},
          {"share_with_particles", withParticles / count}};
}

std::string nameOf(TrainFrom from) {
  const auto names = trainFromNames();
  return std::ranges::find(names, from, [](const auto& name) { return name.second; })->first;
}

nlohmann::ordered_json row(const HeldOut& heldOut, const Trained& trained) {
  nlohmann::ordered_json json{{"train", nameOf(trained.from)}, {"passes", trained.passes}};
  json.update(grade(heldOut, cacheOf(trained.illumination.field)));
  json["processor_seconds"] = trained.seconds;
  json["particles"] = trained.illumination.report.particles();
  json["records"] = trained.illumination.field.records();
  json["record_bytes"] = trained.illumination.field.bytes();
  return json;
}

void run(Options& o) {
  std::optional<oneapi::tbb::global_control> limit;
  if (o.threads > 0) limit.emplace(oneapi::tbb::global_control::max_allowed_parallelism, o.threads);
  std::ranges::sort(o.passes);
  o.plan.passes = o.passes.front();
  o.plan.validate();
  const Scene scene = o.readScene();
  RenderScene renderScene(scene);
  const RayCamera camera(scene.camera, scene.filter);
  renderScene.lights.focus(visibleRegion(renderScene, camera, o.plan.seed, o.plan.maxDepth));
  Progress progress("training", static_cast<double>(o.sources.size() * o.passes.size() + 1));
  std::vector<Trained> trainings;
  for (const TrainFrom from : o.sources) {
    o.plan.from = from;
    trainings.push_back({from, 0, 0, {}});  // untrained: the cosine density
    for (const int passes : o.passes) {
      // Every number of passes is trained from scratch, as in a render with this number of passes.
      o.plan.passes = passes;
      const double start = processorSeconds();
      TrainedIllumination illumination = trainIllumination(renderScene, camera, nullptr, o.plan);
      trainings.push_back({from, passes, processorSeconds() - start, std::move(illumination)});
      progress.advance();
    }
  }
  const HeldOut heldOut = makeHeldOut(renderScene, camera, o, trainings.back().illumination.field);
  progress.advance();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const Trained& trained : trainings) rows.push_back(row(heldOut, trained));
  fmt::print("{}\n", jsonText(rows));
}

void declare(CLI::App& app, Options& o) {
  o.declare(app);
  app.add_option("--passes", o.passes, "Numbers of passes to grade, separated by commas")
      ->delimiter(',')
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--receivers", o.receivers, "Number of surface points at which to grade")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--train", o.sources,
                 "Sources of the training samples: photons, paths or both; several separated by commas")
      ->delimiter(',')
      ->transform(CLI::CheckedTransformer(trainFromNames()))
      ->default_str("both");
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return lobe::runTool(
      "lobebench-illumination",
      "Trains a scene's illumination with several numbers of passes and measures its quality; prints JSON.", argc, argv,
      [&](CLI::App& app) { declare(app, options); }, [&] { run(options); });
}
