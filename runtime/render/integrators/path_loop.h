#pragma once
// The path tracing loop for any guide, which samples directions: emission, next-event estimation with multiple
// importance sampling (power heuristic), delta components of materials, Russian roulette and splitting. The guide only
// samples the non-delta component.
//
// A guide is a type with a nested class Vertex, which the loop constructs where a path scatters at a surface that is
// not purely specular:
//
//   struct Guide {
//     class Vertex {
//       Vertex(const Guide& guide, const SurfaceHit& hit);
//       // Samples a direction, with its BSDF value and its density pdf(wi); nullopt: a sample of value zero.
//       // Counts the strategy that was chosen.
//       std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const;
//       // The density of sample over solid angle.
//       float pdf(const Vec3& wi) const;
//       // Decides on the counts of samples, see sample_counts.h; nullopt: unknown.
//       std::optional<VertexEstimate> estimate() const;
//     };
//   };
//
// Directions are local in hit.frame, whose z axis is on the geometric front side, so hit.wo may have z < 0. hit.bsdf is
// not null.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "runtime/render/integrators/integrator.h"
#include "runtime/render/integrators/light_tracing.h"
#include "runtime/render/integrators/sample_counts.h"
#include "runtime/render/lights/render_scene.h"

namespace lobe {

struct PathOptions {
  int maxDepth = std::numeric_limits<int>::max();  ///< segments: 1 shows emitters only, 2 adds direct light
  int rouletteDepth = 5;                           ///< segments before Russian roulette applies
  /// Counts of samples at vertices with an estimate, as far as the path is not at its first vertex: there, samples of
  /// the pixel are stratified, and more of them are worth more than splitting. Null, and without an estimate: Russian
  /// roulette by throughput.
  const SampleCountModel* counts = nullptr;
  EmitterVisibility emitterVisibility = EmitterVisibility::shown;
  /// Limits the luminance of the indirect light of a sample (FoundLight), and that of every contribution of a light
  /// path that is connected to the camera, > 0. The picture is biased if it is finite.
  float fireflyLimit = std::numeric_limits<float>::infinity();
};

/// Upper bound of the survival probability once Russian roulette applies, so that every path ends.
inline constexpr float kMaxSurvival = 0.95f;

/// Upper bound of the branches that splitting makes of one camera path.
inline constexpr float kMaxBranches = 16;

template <class Guide, class LightPaths = NoLightPaths>
class PathLoop {
 public:
  /// lightPaths: against which the camera paths are weighted (light_tracing.h).
  PathLoop(const RenderScene& scene, const PathOptions& options, const Guide& sampler, LightPaths lightPaths = {})
      : scene_(scene), options_(options), sampler_(sampler), lightPaths_(std::move(lightPaths)) {}

  Rgb radiance(const Ray& cameraRay, Sampler& rng, PathStatistics& statistics) const {
    Path path{cameraRay, &rng, &statistics};
    ++statistics.paths;
    follow(path);
    return path.found.limited(options_.fireflyLimit, statistics.cut);
  }

  /// Traces a path without counts, and appends it to the log.
  void log(const Ray& cameraRay, Sampler& rng, PathLog& log) const {
    PathStatistics statistics;
    Path path{cameraRay, &rng, &statistics};
    path.log = &log;
    const std::size_t begin = log.vertices.size();
    follow(path);
    const float radiance = luminance(path.found.total());
    // As in a film, a path without a finite value is left out.
    if (std::isfinite(radiance))
      log.paths.push_back({log.vertices.size(), radiance, static_cast<float>(statistics.cost())});
    else
      log.vertices.erase(log.vertices.begin() + static_cast<std::ptrdiff_t>(begin), log.vertices.end());
  }

 private:
  struct Path {
    Ray ray;
    Sampler* rng;
    PathStatistics* statistics;
    FoundLight found = {};
    Rgb throughput = Rgb::Ones();
    EmissionWeight emissionWeight = {};
    [[no_unique_address]] typename LightPaths::Weight lightTracing = {};
    Rgb expected = Rgb::Ones();  // product of the albedos: the expected throughput, whatever was sampled
    float eta2 = 1;              // scaling of radiance by refraction so far, which Russian roulette undoes
    int depth = 0;
    bool delta = false;   // the last scattering was by a delta component
    float reference = 0;  // SampleCountModel::reference; 0: no vertex had an estimate yet
    float branches = 1;   // expected number into which the camera path has been split so far
    PathLog* log = nullptr;
  };

  void follow(Path& path) const {
    for (++path.depth; path.depth <= options_.maxDepth; ++path.depth)
      if (!advance(path)) break;
  }

  // Traces one segment and processes its end point; returns false when the path ends.
  bool advance(Path& path) const {
    const bool dark = path.depth == 1 && options_.emitterVisibility != EmitterVisibility::shown;
    const std::optional<SurfaceHit> hit = trace(path);
    if (!hit) {
      if (dark) return false;
      const float weight = path.emissionWeight.ofEnvironment(lightPaths_.atEnvironment(path.lightTracing, path.ray));
      contribute(path, path.throughput * scene_.lights.environmentRadiance(path.ray.direction) * weight);
      return false;
    }
    if (hit->emitter && !dark) {
      const float weight = path.emissionWeight.ofSurface(*hit, lightPaths_.atLight(path.lightTracing, *hit));
      contribute(path, path.throughput * emittedRadiance(*hit) * weight);
    }
    if (!hit->bsdf || path.depth >= options_.maxDepth || !sidesAgree(*hit, hit->woWorld, hit->wo)) return false;
    lightPaths_.arrive(path.lightTracing, path.ray, *hit, path.depth);
    return scatter(path, *hit);
  }

  // Emission that the path has found.
  static void contribute(Path& path, const Rgb& value) {
    contribute(path, value, {Technique::emission, path.depth, path.delta});
  }

  static void contribute(Path& path, const Rgb& value, const PathKind& kind) {
    path.found.add(value, kind.segments);
    path.statistics->largest.add(luminance(value), kind);
  }

  std::optional<SurfaceHit> trace(const Path& path) const {
    if (path.depth == 1) return scene_.firstVisible(path.ray, options_.emitterVisibility, path.statistics->segments);
    ++path.statistics->segments;
    return scene_.tracer.trace(path.ray);
  }

  // Russian roulette by throughput; divides the throughput by the survival probability.
  bool survivesByThroughput(Path& path) const {
    if (path.depth < options_.rouletteDepth) return true;
    // A guided direction has a small throughput because much light is expected from it; the path must not be terminated
    // for that reason.
    const float carried = std::max(path.throughput.maxCoeff() * path.eta2, path.expected.maxCoeff());
    return survives(path, std::min(carried, kMaxSurvival));
  }

  static bool survives(Path& path, float survival) {
    if (path.rng->uniform() >= survival) return false;
    path.throughput /= survival;
    return true;
  }

  // The counts at the vertex; nullopt: the path ends here.
  std::optional<SampleCounts> countsAt(Path& path, const std::optional<VertexEstimate>& estimate) const {
    const float expected = estimate ? luminance(path.throughput) * estimate->reflectedRadiance : 0.0f;
    if (!options_.counts || !(expected > 0) || !std::isfinite(expected))
      return survivesByThroughput(path) ? std::optional(SampleCounts()) : std::nullopt;
    if (path.reference <= 0) path.reference = options_.counts->reference(expected);
    if (path.depth == 1) return SampleCounts();
    SampleCounts counts = options_.counts->counts(estimate->record, expected / path.reference);
    counts.continued = std::min(counts.continued, std::max(1.0f, kMaxBranches / path.branches));
    // Below 1 in long paths, so that every path ends.
    if (path.depth >= options_.rouletteDepth && counts.continued <= 1)
      counts.continued = std::min(counts.continued, kMaxSurvival);
    return counts;
  }

  // A random integer whose expected value is the count.
  static int rounded(float count, Sampler& rng) {
    const float below = std::floor(count);
    return static_cast<int>(below) + (count > below && rng.uniform() < count - below ? 1 : 0);
  }

  // A vertex at which paths scatter by the non-delta component with probability 1 − delta.
  struct Scattering {
    const SurfaceHit& hit;
    const typename Guide::Vertex& vertex;
    const LightSelection lights;
    float delta;
  };

  bool scatter(Path& path, const SurfaceHit& hit) const {
    const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    if (delta >= 1.0f) return survivesByThroughput(path) && scatterDelta(path, hit, delta);
    const typename Guide::Vertex vertex(sampler_, hit);
    const std::optional<VertexEstimate> estimate =
        options_.counts || path.log ? vertex.estimate() : std::optional<VertexEstimate>();
    const std::optional<SampleCounts> counts = countsAt(path, estimate);
    if (!counts) return false;
    const Scattering at{hit, vertex, scene_.lights.at(hit), delta};
    const bool logged = path.log && logVertex(path, estimate);
    addDirectLight(path, at, counts->direct);
    if (logged) logDirect(path);
    return goOn(path, at, counts->continued);
  }

  bool logVertex(Path& path, const std::optional<VertexEstimate>& estimate) const {
    const float throughput = luminance(path.throughput);
    const float expected = estimate ? throughput * estimate->reflectedRadiance : 0.0f;
    if (!(expected > 0) || !std::isfinite(expected)) return false;
    path.log->vertices.push_back(
        {*estimate, throughput, luminance(path.found.total()), 0, static_cast<float>(path.statistics->cost()), 0});
    return true;
  }

  void logDirect(Path& path) const {
    PathLog::Vertex& vertex = path.log->vertices.back();
    vertex.radianceDirect = luminance(path.found.total());
    vertex.costDirect = static_cast<float>(path.statistics->cost());
  }

  // Continues the path in `count` directions on average. The last is followed by the caller: returns whether there is
  // one.
  bool goOn(Path& path, const Scattering& at, float count) const {
    const int copies = rounded(count, *path.rng);
    if (copies == 0) return false;
    path.throughput /= count;
    path.branches *= std::max(1.0f, count);
    for (int i = 1; i < copies; ++i) {
      Sampler rng = path.rng->branch();
      Path branch = path;
      branch.rng = &rng;
      branch.found = {};
      if (scatterAt(branch, at)) follow(branch);
      path.found.add(branch.found);
    }
    return scatterAt(path, at);
  }

  bool scatterAt(Path& path, const Scattering& at) const {
    if (at.delta <= 0.0f || path.rng->uniform() >= at.delta) return scatterSmooth(path, at);
    return scatterDelta(path, at.hit, at.delta);
  }

  // Next-event estimation with `count` samples on average.
  void addDirectLight(Path& path, const Scattering& at, float count) const {
    constexpr int kNumbersOfDirectLight = 3;
    const int samples = rounded(count, *path.rng);
    if (samples == 0) path.rng->skip(kNumbersOfDirectLight);
    if (samples > 0) addDirectLight(path, at, *path.rng, count);
    for (int i = 1; i < samples; ++i) {
      Sampler rng = path.rng->branch();
      addDirectLight(path, at, rng, count);
    }
  }

  // One of `count` samples of next-event estimation.
  void addDirectLight(Path& path, const Scattering& at, Sampler& rng, float count) const {
    const SurfaceHit& hit = at.hit;
    const double choice = rng.stratifiedDouble();
    const std::optional<LightSample> light = at.lights.sample(choice, rng.stratified2());
    if (!light) return;
    const Vec3 wi = hit.frame.toLocal(light->wi);
    if (!sidesAgree(hit, light->wi, wi)) return;
    const Rgb f = evalBsdf(hit, wi);
    if (!(f.maxCoeff() > 0.0f)) return;
    const ArrivingLight arriving = scene_.arriving(hit, *light, options_.maxDepth - path.depth - 1);
    path.statistics->shadowRays += static_cast<std::uint64_t>(arriving.rays);
    if (!(arriving.radiance.maxCoeff() > 0.0f)) return;
    const float byChance = light->delta ? 0.0f : (1.0f - at.delta) * at.vertex.pdf(wi);
    const float weight =
        misWeight(light->pdf, byChance, lightPaths_.ofNextEvent(path.lightTracing, hit, *light, arriving));
    contribute(path, path.throughput * f * arriving.radiance * (std::abs(wi.z()) * weight / (light->pdf * count)),
               {Technique::nextEvent, path.depth + arriving.rays, arriving.rays > 1});
  }

  bool scatterSmooth(Path& path, const Scattering& at) const {
    const SurfaceHit& hit = at.hit;
    path.delta = false;
    const std::optional<BsdfSample> sample = at.vertex.sample(*path.rng, *path.statistics);
    if (!sample) return false;
    const float pdf = (1.0f - at.delta) * sample->pdf;
    path.eta2 *= sample->eta * sample->eta;
    if (!continueAlong(path, hit, sample->wi, sample->f * (std::abs(sample->wi.z()) / pdf))) return false;
    path.emissionWeight.scattered(at.lights, path.ray.direction, pdf);
    lightPaths_.scatter(path.lightTracing, hit, path.ray.direction, pdf);
    return true;
  }

  bool scatterDelta(Path& path, const SurfaceHit& hit, float fraction) const {
    path.statistics->countDelta();
    path.delta = true;
    const std::optional<DeltaSample> sample = sampleDelta(hit, path.rng->uniform());
    if (!sample) return false;
    path.emissionWeight.passed(hit, sample->wi, scene_.shadowSurfaces);
    path.eta2 *= sample->eta * sample->eta;
    if (!continueAlong(path, hit, sample->wi, sample->weight / fraction)) return false;
    lightPaths_.scatterDelta(path.lightTracing, hit, path.ray.direction, sample->eta);
    return true;
  }

  bool continueAlong(Path& path, const SurfaceHit& hit, const Vec3& wi, const Rgb& weight) const {
    const Vec3 direction = hit.frame.toWorld(wi).normalized();
    if (!sidesAgree(hit, direction, wi)) return false;
    path.throughput *= weight;
    path.expected *= hit.bsdf->albedo(hit.wo, hit.uv);
    path.ray = spawnRay(hit, direction);
    return path.throughput.maxCoeff() > 0.0f;
  }

  const RenderScene& scene_;
  const PathOptions& options_;
  const Guide& sampler_;
  [[no_unique_address]] LightPaths lightPaths_;
};

}  // namespace lobe
