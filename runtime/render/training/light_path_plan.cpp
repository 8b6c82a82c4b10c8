#include "runtime/render/training/light_path_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

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

/// The squared value of the pixels of each block.
std::vector<double> squaredValues(const std::vector<Chunk>& chunks, std::size_t blocks) {
  std::vector<double> sums(blocks), counts(blocks);
  for (const Chunk& chunk : chunks)
    for (const CameraSample& sample : chunk.samples) sums[sample.block] += sample.radiance, counts[sample.block] += 1;
  for (std::size_t i = 0; i < blocks; ++i) sums[i] = counts[i] > 0 ? sums[i] / counts[i] : 0;
  const double dark = kDark * median(sums);
  for (double& value : sums) value = value * value + dark * dark;
  return sums;
}

/// The mean without the largest values.
double trimmedMean(std::vector<double> values) {
  std::ranges::sort(values);
  const auto kept = std::max<std::size_t>(
      1, values.size() - static_cast<std::size_t>(kOutliers * static_cast<double>(values.size())));
  return std::accumulate(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(kept), 0.0) /
         static_cast<double>(kept);
}

}  // namespace

double LightPathTrial::inefficiency() const {
  return std::max(variance, secondMoment) * cost;
}

double LightPathTrial::inefficiencyWithLight() const {
  return (std::max(variance, secondMoment) - secondMoment + left) * costWithLight;
}

EnvironmentGuide learnEnvironmentGuide(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& guide,
                                       int paths, std::uint64_t seed) {
  ImportonWishes wishes;
  wishes.uses = true;
  const ParticleTracer tracer(scene, camera, guide, guide, nullptr, seed ^ kTag);
  EnvironmentGuide learnt(scene.lights);
  for (const EnvironmentUse& use : tracer.traceImportons(0, paths, wishes).uses)
    learnt.learn(use.point, use.wi, use.weight);
  learnt.update();
  return learnt;
}

LightPathTrial tryLightPaths(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                             const GuidedSampler& guide, const PhotonEmission& emission, int paths,
                             std::uint64_t seed) {
  const BsdfSampler lightGuide;
  const Blocks blocks(camera, paths);
  const LightTracing tracing{1, emission};
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
      chunk.samples.push_back({blocks.at(film), luminance(loop.radiance(ray, rng, chunk.camera))});
      light.traceLight(tracing, lightRng, chunk.light, chunk.splats);
    }
  });

  const std::vector<double> squares = squaredValues(chunks, blocks.count());
  PathStatistics cameraWork, lightWork;
  for (const Chunk& chunk : chunks) cameraWork += chunk.camera, lightWork += chunk.light;
  const double cost = cameraWork.cost() / paths, lightCost = lightWork.cost() / paths;
  std::vector<double> means(blocks.count()), counts(blocks.count()), deviations;
  for (const Chunk& chunk : chunks)
    for (const CameraSample& s : chunk.samples) means[s.block] += s.radiance, counts[s.block] += 1;
  for (std::size_t i = 0; i < means.size(); ++i) means[i] /= std::max(1.0, counts[i]);
  for (const Chunk& chunk : chunks)
    for (const CameraSample& s : chunk.samples) {
      const double difference = s.radiance - means[s.block];
      deviations.push_back(squares[s.block] > 0 ? difference * difference / squares[s.block] : 0);
    }
  const double variance = trimmedMean(std::move(deviations));

  const double pixels = static_cast<double>(camera.width()) * camera.height();
  LightPathTrial best;
  for (const double perPixel : kPathsPerPixel) {
    LightPathTrial trial{variance, cost, perPixel, 0, 0, kWeightingCost * cost + perPixel * lightCost};
    const double count = perPixel * pixels;
    for (const Chunk& chunk : chunks)
      for (const Splat& splat : chunk.splats) {
        // Of a single light path, without weights.
        const double whole = luminance(splat.value) * pixels * (1.0 + splat.others);
        const double scale = squares[blocks.at(splat.film)] * pixels * paths;
        if (!(whole > 0) || !(scale > 0)) continue;
        // Light that camera paths cannot find at all would have an infinite second moment.
        const double others = std::max(splat.others / squared(perPixel), kLeastOthers);
        const double weight = 1 / (1 + others);
        const double moment = squared(whole) / (count * std::sqrt(others)) / scale;
        trial.secondMoment += moment;
        trial.left += moment * squared(others * weight) + squared(whole * weight) / count / scale;
      }
    if (best.pathsPerPixel == 0 || trial.inefficiencyWithLight() < best.inefficiencyWithLight()) best = trial;
  }
  return best;
}

}  // namespace lobe
