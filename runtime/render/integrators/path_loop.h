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
//       // Estimate of the radiance reflected towards wo, luminance, in units that all vertices share; nullopt:
//       // unknown.
//       std::optional<float> reflectedRadiance() const;
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
#include "runtime/render/lights/render_scene.h"

namespace lobe {

/// Russian roulette by the path's throughput, or adjoint-driven: Russian roulette and splitting keep each path's
/// expected contribution near the estimate at its first vertex (Vorba and Křivánek 2016, "Adjoint-Driven Russian
/// Roulette and Splitting"). The paper compares with an estimate of the pixel instead; the estimate at the first vertex
/// has the same units and errors as those at later vertices. Vertices without an estimate use the throughput.
enum class RussianRoulette { throughput, adjoint };

struct PathOptions {
  int maxDepth = std::numeric_limits<int>::max();  ///< segments: 1 shows emitters only, 2 adds direct light
  int rouletteDepth = 5;                           ///< segments before Russian roulette applies
  RussianRoulette russianRoulette = RussianRoulette::adjoint;
  EmitterVisibility emitterVisibility = EmitterVisibility::shown;
};

/// Upper bound of the survival probability once Russian roulette applies, so that every path ends.
inline constexpr float kMaxSurvival = 0.95f;

/// Bounds of the weight window, for the ratio of expected contribution and reference: their ratio is 5 and their mean 1
/// (Vorba and Křivánek 2016, Eq. 6).
inline constexpr float kWeightWindowLow = 1.0f / 3.0f, kWeightWindowHigh = 5.0f / 3.0f;
/// Lower bound of the survival probability: estimates may be far too low, and the throughput of survivors is divided by
/// it.
inline constexpr float kLeastSurvival = 0.2f;
/// Upper bound of the branches that splitting makes of one camera path.
inline constexpr int kMaxBranches = 16;

template <class Guide>
class PathLoop {
 public:
  PathLoop(const RenderScene& scene, const PathOptions& options, const Guide& sampler)
      : scene_(scene), options_(options), sampler_(sampler) {}

  Rgb radiance(const Ray& cameraRay, Sampler& rng, PathStatistics& statistics) const {
    Path path{cameraRay, rng, statistics};
    ++statistics.paths;
    follow(path);
    return path.radiance;
  }

 private:
  struct Path {
    Ray ray;
    Sampler& rng;
    PathStatistics& statistics;
    Rgb radiance = Rgb::Zero();
    Rgb throughput = Rgb::Ones();
    EmissionWeight emissionWeight = {};
    Rgb expected = Rgb::Ones();  // product of the albedos: the expected throughput, whatever was sampled
    float eta2 = 1;              // scaling of radiance by refraction so far, which Russian roulette undoes
    int depth = 0;
    float reference = 0;  // expected contribution at the first vertex with an estimate; 0: none yet
    int branches = 1;     // into which the camera path has been split so far
  };

  void follow(Path& path) const {
    for (++path.depth; path.depth <= options_.maxDepth; ++path.depth)
      if (!advance(path)) break;
  }

  // Traces one segment and processes its end point; returns false when the path ends.
  bool advance(Path& path) const {
    ++path.statistics.segments;
    const bool dark = path.depth == 1 && options_.emitterVisibility != EmitterVisibility::shown;
    const std::optional<SurfaceHit> hit = dark ? firstVisible(path) : scene_.tracer.trace(path.ray);
    if (!hit) {
      if (dark) return false;
      path.radiance += path.throughput * scene_.lights.environmentRadiance(path.ray.direction) *
                       path.emissionWeight.ofEnvironment(scene_.lights);
      return false;
    }
    if (hit->emitter && !dark)
      path.radiance += path.throughput * emittedRadiance(*hit) * path.emissionWeight.ofSurface(scene_.lights, *hit);
    if (!hit->bsdf || path.depth >= options_.maxDepth || !sidesAgree(*hit, hit->woWorld, hit->wo)) return false;
    return scatter(path, *hit);
  }

  // The first surface that a camera path meets if the camera does not see emitters as such.
  std::optional<SurfaceHit> firstVisible(Path& path) const {
    for (;;) {
      std::optional<SurfaceHit> hit = scene_.tracer.trace(path.ray);
      if (!hit || !hit->emitter || options_.emitterVisibility == EmitterVisibility::dark) return hit;
      path.ray.tfar -= hit->distance;
      path.ray.origin = offsetPoint(*hit, path.ray.direction);
      ++path.statistics.segments;
    }
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
    if (path.rng.uniform() >= survival) return false;
    path.throughput /= survival;
    return true;
  }

  // Number of branches that continue from the vertex; 0 if the path ends here.
  int continuations(Path& path, const typename Guide::Vertex& vertex) const {
    const std::optional<float> leaving =
        options_.russianRoulette == RussianRoulette::adjoint ? vertex.reflectedRadiance() : std::nullopt;
    const float expected = leaving ? luminance(path.throughput) * *leaving : 0.0f;
    if (!leaving || !std::isfinite(expected)) return survivesByThroughput(path) ? 1 : 0;
    if (path.reference <= 0) path.reference = expected;
    const float ratio = path.reference > 0 ? expected / path.reference : 1.0f;
    // Below 1 in long paths, so that every path ends.
    const float most = path.depth >= options_.rouletteDepth ? kMaxSurvival : 1.0f;
    if (!(ratio >= kWeightWindowLow))
      return survives(path, std::clamp(ratio / kWeightWindowLow, kLeastSurvival, most)) ? 1 : 0;
    if (!survives(path, most)) return 0;
    const int room = kMaxBranches / path.branches;
    return ratio <= kWeightWindowHigh ? 1 : std::max(1, std::min(static_cast<int>(std::min(ratio, 1e3f)), room));
  }

  bool scatter(Path& path, const SurfaceHit& hit) const {
    const float deltaFraction = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    if (deltaFraction >= 1.0f) return survivesByThroughput(path) && scatterDelta(path, hit, deltaFraction);
    const typename Guide::Vertex vertex(sampler_, hit);
    const int copies = continuations(path, vertex);
    if (copies == 0) return false;
    path.throughput /= static_cast<float>(copies);
    path.branches *= copies;
    for (int i = 1; i < copies; ++i) {
      Path branch = path;
      branch.radiance = Rgb::Zero();
      if (scatterAt(branch, hit, vertex, deltaFraction)) follow(branch);
      path.radiance += branch.radiance;
    }
    return scatterAt(path, hit, vertex, deltaFraction);
  }

  bool scatterAt(Path& path, const SurfaceHit& hit, const typename Guide::Vertex& vertex, float deltaFraction) const {
    addDirectLight(path, hit, vertex, 1.0f - deltaFraction);
    if (deltaFraction <= 0.0f || path.rng.uniform() >= deltaFraction)
      return scatterSmooth(path, hit, vertex, 1.0f - deltaFraction);
    return scatterDelta(path, hit, deltaFraction);
  }

  void addDirectLight(Path& path, const SurfaceHit& hit, const typename Guide::Vertex& vertex, float fraction) const {
    const float choice = path.rng.stratified();
    const std::optional<LightSample> light = scene_.lights.sample(hit.position, choice, path.rng.stratified2());
    if (!light) return;
    const Vec3 wi = hit.frame.toLocal(light->wi);
    if (!sidesAgree(hit, light->wi, wi)) return;
    const Rgb f = evalBsdf(hit, wi);
    if (!(f.maxCoeff() > 0.0f)) return;
    const ArrivingLight arriving = scene_.arriving(hit, *light, options_.maxDepth - path.depth - 1);
    path.statistics.shadowRays += static_cast<std::uint64_t>(arriving.rays);
    if (!(arriving.radiance.maxCoeff() > 0.0f)) return;
    const float weight = light->delta ? 1.0f : misWeight(light->pdf, fraction * vertex.pdf(wi));
    path.radiance += path.throughput * f * arriving.radiance * (std::abs(wi.z()) * weight / light->pdf);
  }

  bool scatterSmooth(Path& path, const SurfaceHit& hit, const typename Guide::Vertex& vertex, float fraction) const {
    const std::optional<BsdfSample> sample = vertex.sample(path.rng, path.statistics);
    if (!sample) return false;
    const float pdf = fraction * sample->pdf;
    path.eta2 *= sample->eta * sample->eta;
    if (!continueAlong(path, hit, sample->wi, sample->f * (std::abs(sample->wi.z()) / pdf))) return false;
    path.emissionWeight.scattered(hit.position, path.ray.direction, pdf);
    return true;
  }

  bool scatterDelta(Path& path, const SurfaceHit& hit, float fraction) const {
    path.statistics.countDelta();
    const std::optional<DeltaSample> sample = sampleDelta(hit, path.rng.uniform());
    if (!sample) return false;
    path.emissionWeight.passed(hit, sample->wi, scene_.shadowSurfaces);
    path.eta2 *= sample->eta * sample->eta;
    return continueAlong(path, hit, sample->wi, sample->weight / fraction);
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
};

}  // namespace lobe
