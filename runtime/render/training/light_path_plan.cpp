#include "runtime/render/training/light_path_plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/core/colour.h"
#include "runtime/core/parallel.h"
#include "runtime/core/statistics.h"
#include "runtime/render/integrators/bidirectional_paths.h"
#include "runtime/render/training/particle_tracer.h"

namespace lobe {
namespace {

// Keeps the random numbers apart from those of training and of rendering with the same seed.
constexpr std::uint64_t kTag = 0x6c69676874747279;
constexpr int kChunk = 1024;
constexpr std::array kPathsPerPixel{0.125, 0.25, 0.5, 1.0};
// The fewest light paths are used whose inefficiency is at most this times the least. Most pixels have no outliers:
// light paths cost them time and hardly help them.
constexpr double kTolerance = 2;
// Camera paths with light paths take this much longer, because of the densities in the weights.
constexpr double kWeightingCost = 1.1;
// Errors of pixels that are darker than this fraction of the median count less.
constexpr double kDark = 0.5;
constexpr double kOutliers = 0.005;
constexpr double kLeastOthers = 1e-12;

/// Squares of pixels, so that each has enough camera paths to estimate its value.
class Blocks {
 public:
  Blocks(const RayCamera& camera, int paths) {
    constexpr double kPaths = 32;  // in a block, on average
    const double pixels = static_cast<double>(camera.width()) * camera.height();
    size_ = std::max(1.0f, static_cast<float>(std::sqrt(pixels * kPaths / paths)));
    columns_ = static_cast<int>(std::ceil(static_cast<float>(camera.width()) / size_));
    rows_ = static_cast<int>(std::ceil(static_cast<float>(camera.height()) / size_));
  }
  std::size_t count() const { return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_); }
  std::size_t at(const Vec2& film) const {
    const int x = std::clamp(static_cast<int>(film.x() / size_), 0, columns_ - 1);
    const int y = std::clamp(static_cast<int>(film.y() / size_), 0, rows_ - 1);
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x);
  }

 private:
  float size_;
  int columns_, rows_;
};

struct CameraSample {
  std::size_t block;
  float radiance;
};

/// The work of one chunk, in order.
struct Chunk {
  PathStatistics camera, light;
  std::vector<CameraSample> samples;
  std::vector<Splat> splats;
};

/// The values of the pixels of each block, and their squares, bounded from below.
struct BlockValues {
  std::vector<double> means, squares;
};

BlockValues valuesOf(const std::vector<Chunk>& chunks, std::size_t blocks) {
  BlockValues values{std::vector<double>(blocks), std::vector<double>(blocks)};
  std::vector<double> counts(blocks);
  for (const Chunk& chunk : chunks)
    for (const CameraSample& sample : chunk.samples)
      values.means[sample.block] += sample.radiance, counts[sample.block] += 1;
  for (std::size_t i = 0; i < blocks; ++i) values.means[i] /= std::max(1.0, counts[i]);
  const double dark = kDark * median(values.means);
  std::ranges::transform(values.means, values.squares.begin(), [&](double m) { return m * m + dark * dark; });
  return values;
}

/// Traces equally many camera paths and light paths, one per pixel.
std::vector<Chunk> trace(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                         const GuidedSampler& guide, const LightTracing& tracing, const Blocks& blocks, int paths,
                         std::uint64_t seed) {
  const BsdfSampler lightGuide;
  std::vector<Chunk> chunks((paths + kChunk - 1) / kChunk);
  parallelFor(std::size_t{0}, chunks.size(), [&](std::size_t c) {
    Chunk& chunk = chunks[c];
    const PathLoop loop(scene, options, guide);
    BidirectionalPaths light(scene, camera, options, guide, lightGuide);
    const int first = static_cast<int>(c) * kChunk;
    for (int i = first; i < std::min(paths, first + kChunk); ++i) {
      Sampler rng(seed ^ kTag, 0, i), lightRng(seed ^ kTag, 1, i);
      const Vec2 pixel = rng.uniform2();
      const Vec2 film(pixel.x() * static_cast<float>(camera.width()), pixel.y() * static_cast<float>(camera.height()));
      const Ray ray = camera.sample(static_cast<int>(film.x()), static_cast<int>(film.y()), rng);
      const float radiance = luminance(loop.radiance(ray, rng, chunk.camera));
      if (std::isfinite(radiance)) chunk.samples.push_back({blocks.at(film), radiance});
      light.traceLight(tracing, lightRng, chunk.light, chunk.splats);
    }
  });
  return chunks;
}

double trimmedVariance(const std::vector<Chunk>& chunks, const BlockValues& values) {
  std::vector<double> deviations;
  for (const Chunk& chunk : chunks)
    for (const CameraSample& sample : chunk.samples) {
      const double square = values.squares[sample.block];
      deviations.push_back(square > 0 ? squared(sample.radiance - values.means[sample.block]) / square : 0);
    }
  return trimmedMean(std::move(deviations), kOutliers);
}

/// Adds the moments of a contribution, made with one light path per pixel, to a trial with another number. scale: the
/// squared value of the pixel, times what makes sums of light paths means over pixels.
void addMoments(LightPathTrial& trial, const Splat& splat, double pixels, double scale) {
  // Of a single light path, without weights.
  const double whole = luminance(splat.value) * pixels * (1.0 + splat.others);
  if (!(whole > 0) || !std::isfinite(whole) || !(scale > 0)) return;
  const double count = trial.pathsPerPixel * pixels;
  // Light that camera paths cannot find at all would have an infinite second moment.
  const double others = std::max(splat.others / squared(trial.pathsPerPixel), kLeastOthers);
  const double weight = 1 / (1 + others);
  const double moment = squared(whole) / (count * std::sqrt(others)) / scale;
  trial.secondMoment += moment;
  trial.secondMomentLeft += moment * squared(others * weight) + squared(whole * weight) / count / scale;
}

}  // namespace

double LightPathTrial::inefficiency() const {
  return std::max(variance, secondMoment) * cost;
}

double LightPathTrial::inefficiencyWithLight() const {
  return (std::max(variance, secondMoment) - secondMoment + secondMomentLeft) * costWithLight;
}

EnvironmentGuide learnEnvironmentGuide(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                                       const GuidedSampler& guide, int paths, std::uint64_t seed) {
  ImportonWishes wishes;
  wishes.uses = true;
  const ParticleTracer tracer(scene, camera, guide, guide, nullptr, seed ^ kTag, options.maxDepth);
  EnvironmentGuide learnt(scene.lights);
  for (const EnvironmentUse& use : tracer.traceImportons(0, paths, wishes).uses)
    learnt.learn(use.point, use.wi, use.weight);
  learnt.update();
  return learnt;
}

LightPathTrial tryLightPaths(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                             const GuidedSampler& guide, const PhotonEmission& emission, int paths,
                             std::uint64_t seed) {
  PathOptions unlimited = options;
  unlimited.fireflyLimit = kInfinity;
  const Blocks blocks(camera, paths);
  const std::vector<Chunk> chunks = trace(scene, camera, unlimited, guide, {1, emission}, blocks, paths, seed);
  const BlockValues values = valuesOf(chunks, blocks.count());
  PathStatistics ofCamera, ofLight;
  for (const Chunk& chunk : chunks) ofCamera += chunk.camera, ofLight += chunk.light;
  const double variance = trimmedVariance(chunks, values), cost = ofCamera.cost() / paths;
  const double pixels = static_cast<double>(camera.width()) * camera.height();
  std::vector<LightPathTrial> trials;
  for (const double perPixel : kPathsPerPixel) {
    LightPathTrial& trial = trials.emplace_back();
    trial.variance = variance, trial.cost = cost, trial.pathsPerPixel = perPixel;
    trial.costWithLight = kWeightingCost * cost + perPixel * ofLight.cost() / paths;
    for (const Chunk& chunk : chunks)
      for (const Splat& splat : chunk.splats)
        addMoments(trial, splat, pixels, values.squares[blocks.at(splat.film)] * pixels * paths);
  }
  const auto best = std::ranges::min_element(trials, {}, &LightPathTrial::inefficiencyWithLight);
  const double most = kTolerance * best->inefficiencyWithLight();
  return *std::find_if(trials.begin(), best, [&](const auto& t) { return t.inefficiencyWithLight() <= most; });
}

}  // namespace lobe
