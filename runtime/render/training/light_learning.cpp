#include "runtime/render/training/light_learning.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "runtime/core/parallel.h"
#include "runtime/render/training/camera_walk.h"

namespace lobe {
namespace {

// Keeps the random numbers apart from those of training and rendering with the same seed.
constexpr std::uint64_t kLearningSeed = 0x6c69676874733031;

// One path for so many pixels costs one or two percent of rendering for ten seconds.
constexpr std::int64_t kPixelsPerPath = 4;
constexpr std::int64_t kLeastPaths = 1 << 12, kMostPaths = 1 << 17;
constexpr int kChunk = 512;
constexpr int kSamplesPerVertex = 2;
// Distance of positions that counts as much as orthogonal normals, as a fraction of the diagonal of the region.
constexpr float kNormalLength = 0.2f;

/// Probabilities with which clusters are chosen for the observations.
struct Exploration {
  std::vector<float> everywhere;
  LightCells cells;  // instead, if not empty

  const float* at(const LightReceiver& at) const { return cells.empty() ? everywhere.data() : cells.find(at); }
};

/// Takes light samples at the vertices of camera paths.
class LightObserver {
 public:
  LightObserver(const RenderScene& scene, const Exploration& exploration, Sampler& rng,
                std::vector<LightObservation>& result)
      : scene_(scene), exploration_(exploration), rng_(rng), result_(result) {}

  void observe(const SurfaceHit& hit, float smoothFraction) {
    const LightReceiver at = Lights::receiver(hit);
    const LightSelection lights(scene_.lights, at, exploration_.at(at));
    double choice = rng_.uniformDouble();
    const int cluster = lights.chooseCluster(choice);
    const Vec2 u = rng_.uniform2();
    const float importance = scene_.lights.importance(cluster, at);
    if (!(importance > 0)) return;
    const std::optional<LightSample> light = lights.sample(cluster, choice, u);
    const float value = light ? contribution(hit, *light, smoothFraction) : 0.0f;
    const float ratio = value * lights.clusterProbability(cluster) / importance;
    if (std::isfinite(ratio * ratio)) result_.push_back({at, static_cast<std::uint32_t>(cluster), ratio * ratio});
  }

 private:
  /// The reflected radiance that next-event estimation adds with this sample.
  float contribution(const SurfaceHit& hit, const LightSample& light, float smoothFraction) {
    const Vec3 wi = hit.frame.toLocal(light.wi);
    if (!sidesAgree(hit, light.wi, wi)) return 0;
    const Rgb f = evalBsdf(hit, wi);
    if (!(f.maxCoeff() > 0)) return 0;
    const ArrivingLight arriving = scene_.arriving(hit, light, scene_.shadowSurfaces);
    if (!(arriving.radiance.maxCoeff() > 0)) return 0;
    const float weight = light.delta ? 1.0f : misWeight(light.pdf, smoothFraction * hit.bsdf->pdf(hit.wo, wi, hit.uv));
    return luminance(f * arriving.radiance) * std::abs(wi.z()) * weight / light.pdf;
  }

  const RenderScene& scene_;
  const Exploration& exploration_;
  Sampler& rng_;
  std::vector<LightObservation>& result_;
};

std::vector<LightObservation> observations(const RenderScene& scene, const RayCamera& camera,
                                           const Exploration& exploration, std::uint64_t seed, int maxDepth, int round,
                                           int paths) {
  const int chunks = (paths + kChunk - 1) / kChunk;
  std::vector<std::vector<LightObservation>> parts(chunks);
  parallelFor(0, chunks, [&](int chunk) {
    for (int i = chunk * kChunk; i < std::min(paths, (chunk + 1) * kChunk); ++i) {
      Sampler rng(seed ^ kLearningSeed, round, i);
      LightObserver observer(scene, exploration, rng, parts[chunk]);
      walkFromCamera(scene, camera, maxDepth, rng, [&](const SurfaceHit& hit, float delta) {
        if (delta >= 1) return;
        for (int k = 0; k < kSamplesPerVertex; ++k) observer.observe(hit, 1 - delta);
      });
    }
  });
  std::vector<LightObservation> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

}  // namespace

LightCells learnLightCells(const RenderScene& scene, const RayCamera& camera, std::uint64_t seed, int maxDepth) {
  const Lights& lights = scene.lights;
  if (lights.clusters() < 2) return {};
  std::vector<float> prior, exploring;
  for (int i = 0; i < lights.clusters(); ++i) {
    prior.push_back(lights.prior(i));
    exploring.push_back(0.5f * prior.back() + 0.5f / static_cast<float>(lights.clusters()));
  }
  const auto importance = [&](int cluster, const LightReceiver& at) { return lights.importance(cluster, at); };
  const float length = kNormalLength * lights.region().diagonal();
  const auto pixels = static_cast<std::int64_t>(camera.width()) * camera.height();
  const auto paths = static_cast<int>(std::clamp(pixels / kPixelsPerPath, kLeastPaths, kMostPaths));
  // The second half of the observations is made where the first half has found light.
  Exploration exploration{cumulative(std::vector<double>(exploring.begin(), exploring.end())), {}};
  std::vector<LightObservation> all = observations(scene, camera, exploration, seed, maxDepth, 0, paths / 2);
  exploration.cells = LightCells(all, exploring, importance, length);
  const std::vector<LightObservation> more = observations(scene, camera, exploration, seed, maxDepth, 1, paths / 2);
  all.insert(all.end(), more.begin(), more.end());
  return {std::move(all), prior, importance, length};
}

}  // namespace lobe
