#include "runtime/render/integrators/pilot.h"

#include <algorithm>
#include <array>

#include "runtime/core/colour.h"
#include "runtime/core/parallel.h"
#include "runtime/core/random.h"
#include "runtime/core/statistics.h"
#include "runtime/core/stopwatch.h"
#include "runtime/render/film/film.h"

namespace lobe {
namespace {

// Keeps the random numbers apart from those of training and of rendering with the same seed.
constexpr std::uint64_t kTag = 0x70696c6f74;
// Errors of pixels that are darker than this fraction of the median count less.
constexpr double kDark = 0.5;
constexpr double kOutliers = 0.005;

/// Tiles that are spread over an image.
class Tiling {
 public:
  Tiling(const RayCamera& camera, const PilotOptions& options)
      : width_(camera.width()), size_(std::min({kSize, camera.width(), camera.height()})) {
    const int columns = width_ / size_, rows = camera.height() / size_;
    if (static_cast<std::int64_t>(columns) * rows <= options.tiles) {
      for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) tiles_.push_back({column * size_, row * size_});
      return;
    }
    for (int i = 0; i < options.tiles; ++i) {
      const Eigen::Vector2f u = Sampler::stratified(options.seed, kTag, static_cast<std::uint32_t>(i)).stratified2();
      tiles_.push_back({static_cast<int>(u.x() * static_cast<float>(columns)) * size_,
                        static_cast<int>(u.y() * static_cast<float>(rows)) * size_});
    }
  }
  std::size_t tiles() const { return tiles_.size(); }
  std::size_t pixelsPerTile() const { return static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_); }
  /// The index in the image of pixel i, which belongs to tile i / pixelsPerTile().
  std::uint64_t pixel(std::size_t i) const {
    const auto [left, top] = tiles_[i / pixelsPerTile()];
    const int within = static_cast<int>(i % pixelsPerTile());
    return static_cast<std::uint64_t>(top + within / size_) * static_cast<std::uint64_t>(width_) +
           static_cast<std::uint64_t>(left + within % size_);
  }

 private:
  static constexpr int kSize = 2;
  int width_, size_;
  std::vector<std::array<int, 2>> tiles_;  // left, top
};

using Radiance = Eigen::Array3d;

struct PixelPair {
  std::array<Radiance, 2> means{Radiance::Zero(), Radiance::Zero()};
  double cost = 0;
  Radiance mean() const { return 0.5 * (means[0] + means[1]); }
};

/// The mean of the samples that a film would not drop.
class UsableMean {
 public:
  void add(const Rgb& sample) {
    if (!isUsableSample(sample)) return;
    sum_ += sample.cast<double>();
    ++count_;
  }
  Radiance mean() const { return sum_ / std::max(1, count_); }

 private:
  Radiance sum_ = Radiance::Zero();
  int count_ = 0;
};

PixelPair renderPair(const RayCamera& camera, const Integrator& integrator, std::uint64_t pixel,
                     const PilotOptions& options) {
  PixelPair pair;
  PathStatistics statistics;
  const Stopwatch watch;
  const auto width = static_cast<std::uint64_t>(camera.width());
  for (std::size_t picture = 0; picture < 2; ++picture) {
    const std::uint64_t seed = Rng(options.seed, kTag, picture).next();
    UsableMean usable;
    for (int s = 0; s < options.samples; ++s) {
      Sampler rng = Sampler::stratified(seed, pixel, static_cast<std::uint32_t>(s));
      const Ray ray = camera.sample(static_cast<int>(pixel % width), static_cast<int>(pixel / width), rng);
      usable.add(integrator.radiance(ray, rng, statistics));
    }
    pair.means[picture] = usable.mean();
  }
  pair.cost = (options.timed ? watch.seconds() : statistics.cost()) / (2.0 * options.samples);
  return pair;
}

}  // namespace

PilotComparison compared(const PilotResult& path, const PilotResult& product, bool brief) {
  constexpr double kNoisy = 0.03;  // below this variance, stratification matters
  return {path, product, path.variance > kNoisy && !brief ? 1.0 : PilotComparison::kClearlyBetter};
}

std::vector<PilotResult> comparePilots(const RayCamera& camera, std::span<const Integrator* const> integrators,
                                       const PilotOptions& options) {
  const Tiling tiling(camera, options);
  const std::size_t count = tiling.tiles() * tiling.pixelsPerTile();
  std::vector<std::vector<PixelPair>> pairs(integrators.size(), std::vector<PixelPair>(count));
  parallelFor(std::size_t{0}, count, [&](std::size_t i) {
    for (std::size_t k = 0; k < integrators.size(); ++k)
      pairs[k][i] = renderPair(camera, *integrators[k], tiling.pixel(i), options);
  });
  std::vector<Radiance> tileMeans(tiling.tiles(), Radiance::Zero());
  for (const auto& ofIntegrator : pairs)
    for (std::size_t i = 0; i < count; ++i)
      tileMeans[i / tiling.pixelsPerTile()] +=
          ofIntegrator[i].mean() / static_cast<double>(tiling.pixelsPerTile() * integrators.size());
  std::vector<double> luminances;
  luminances.reserve(tileMeans.size());
  for (const Radiance& mean : tileMeans) luminances.push_back(luminance(mean.cast<float>().eval()));
  const double dark = kDark * median(std::move(luminances));
  std::vector<PilotResult> results;
  for (const auto& ofIntegrator : pairs) {
    PilotResult result;
    std::vector<double> variances(count);
    for (std::size_t i = 0; i < count; ++i) {
      const Radiance difference = ofIntegrator[i].means[0] - ofIntegrator[i].means[1];
      const Radiance square = tileMeans[i / tiling.pixelsPerTile()].square() + dark * dark;
      variances[i] = (square > 0).select(0.5 * difference.square() / square, 0).mean();
      result.cost += ofIntegrator[i].cost / static_cast<double>(count);
    }
    result.variance = trimmedMean(std::move(variances), kOutliers);
    results.push_back(result);
  }
  return results;
}

}  // namespace lobe
