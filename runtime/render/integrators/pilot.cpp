#include "runtime/render/integrators/pilot.h"

#include <algorithm>
#include <array>

#include "runtime/core/colour.h"
#include "runtime/core/parallel.h"
#include "runtime/core/random.h"
#include "runtime/core/statistics.h"
#include "runtime/core/stopwatch.h"

namespace lobe {
namespace {

// Keeps the random numbers apart from those of training and of rendering with the same seed.
constexpr std::uint64_t kTag = 0x70696c6f74;
// Errors of pixels that are darker than this fraction of the median count less.
constexpr double kDark = 0.5;
constexpr double kOutliers = 0.005;

/// Tiles that are spread over an image, in the order of its tiles by rows.
class Tiling {
 public:
  Tiling(const RayCamera& camera, int most)
      : width_(camera.width()), size_(std::min({kSize, camera.width(), camera.height()})) {
    columns_ = width_ / size_;
    all_ = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(camera.height() / size_);
    tiles_ = std::min(all_, static_cast<std::size_t>(most));
  }
  std::size_t tiles() const { return tiles_; }
  std::size_t pixelsPerTile() const { return static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_); }
  /// The index in the image of pixel i, which belongs to tile i / pixelsPerTile().
  std::uint64_t pixel(std::size_t i) const {
    const std::size_t tile = i / pixelsPerTile() * all_ / tiles_;
    const int within = static_cast<int>(i % pixelsPerTile());
    const int column = static_cast<int>(tile % static_cast<std::size_t>(columns_)) * size_ + within % size_;
    const int row = static_cast<int>(tile / static_cast<std::size_t>(columns_)) * size_ + within / size_;
    return static_cast<std::uint64_t>(row) * static_cast<std::uint64_t>(width_) + static_cast<std::uint64_t>(column);
  }

 private:
  static constexpr int kSize = 4;
  int width_, size_, columns_;
  std::size_t all_, tiles_;
};

struct PixelPair {
  std::array<double, 2> means{};
  double cost = 0;
  double mean() const { return 0.5 * (means[0] + means[1]); }
};

PixelPair renderPair(const RayCamera& camera, const Integrator& integrator, std::uint64_t pixel,
                     const PilotOptions& options) {
  PixelPair pair;
  PathStatistics statistics;
  const Stopwatch watch;
  const auto width = static_cast<std::uint64_t>(camera.width());
  for (std::size_t picture = 0; picture < 2; ++picture) {
    const std::uint64_t seed = Rng(options.seed, kTag, picture).next();
    for (int s = 0; s < options.samples; ++s) {
      Sampler rng = Sampler::stratified(seed, pixel, static_cast<std::uint32_t>(s));
      const Ray ray = camera.sample(static_cast<int>(pixel % width), static_cast<int>(pixel / width), rng);
      pair.means[picture] += luminance(integrator.radiance(ray, rng, statistics)) / options.samples;
    }
  }
  pair.cost = (options.timed ? watch.seconds() : statistics.cost()) / (2.0 * options.samples);
  return pair;
}

}  // namespace

std::vector<PilotResult> comparePilots(const RayCamera& camera, std::span<const Integrator* const> integrators,
                                       const PilotOptions& options) {
  const Tiling tiling(camera, options.tiles);
  const std::size_t count = tiling.tiles() * tiling.pixelsPerTile();
  std::vector<std::vector<PixelPair>> pairs(integrators.size(), std::vector<PixelPair>(count));
  parallelFor(std::size_t{0}, count, [&](std::size_t i) {
    for (std::size_t k = 0; k < integrators.size(); ++k)
      pairs[k][i] = renderPair(camera, *integrators[k], tiling.pixel(i), options);
  });
  std::vector<double> tileMeans(tiling.tiles());
  for (const auto& ofIntegrator : pairs)
    for (std::size_t i = 0; i < count; ++i)
      tileMeans[i / tiling.pixelsPerTile()] +=
          ofIntegrator[i].mean() / static_cast<double>(tiling.pixelsPerTile() * integrators.size());
  const double dark = kDark * median(tileMeans);
  std::vector<PilotResult> results;
  for (const auto& ofIntegrator : pairs) {
    PilotResult result;
    std::vector<double> variances(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double difference = ofIntegrator[i].means[0] - ofIntegrator[i].means[1];
      const double mean = tileMeans[i / tiling.pixelsPerTile()];
      const double square = mean * mean + dark * dark;
      variances[i] = square > 0 ? 0.5 * difference * difference / square : 0;
      result.cost += ofIntegrator[i].cost / static_cast<double>(count);
    }
    result.variance = trimmedMean(std::move(variances), kOutliers);
    results.push_back(result);
  }
  return results;
}

}  // namespace lobe
