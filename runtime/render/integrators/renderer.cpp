#include "runtime/render/integrators/renderer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include "runtime/core/stopwatch.h"

namespace lobe {
namespace {

constexpr int kTileSize = 16;

/// Samples [first, last) of every pixel.
struct Wave {
  int first, last;
};

class WaveRenderer {
 public:
  WaveRenderer(const RayCamera& camera, const Integrator& integrator, Film& film, const RenderOptions& options)
      : camera_(camera), integrator_(integrator), film_(film), seed_(options.seed), sampling_(options.sampling) {
    columns_ = (film.width() + kTileSize - 1) / kTileSize;
    tiles_ = columns_ * ((film.height() + kTileSize - 1) / kTileSize);
  }

  PathStatistics render(const Wave& wave) const {
    std::vector<PathStatistics> perTile(tiles_);
    const oneapi::tbb::blocked_range<int> range(0, tiles_, 1);
    oneapi::tbb::parallel_for(
        range,
        [&](const auto& tiles) {
          for (int tile = tiles.begin(); tile < tiles.end(); ++tile) perTile[tile] = renderTile(tile, wave);
        },
        oneapi::tbb::simple_partitioner());
    PathStatistics sum;
    for (const PathStatistics& s : perTile) sum += s;
    return sum;
  }

 private:
  PathStatistics renderTile(int tile, const Wave& wave) const {
    PathStatistics statistics;
    const int x0 = tile % columns_ * kTileSize;
    const int y0 = tile / columns_ * kTileSize;
    for (int y = y0; y < std::min(y0 + kTileSize, film_.height()); ++y)
      for (int x = x0; x < std::min(x0 + kTileSize, film_.width()); ++x) renderPixel(x, y, wave, statistics);
    return statistics;
  }

  void renderPixel(int x, int y, const Wave& wave, PathStatistics& statistics) const {
    const auto pixel = static_cast<std::uint64_t>(y) * film_.width() + x;
    for (int s = wave.first; s < wave.last; ++s) {
      Sampler rng = sampling_ == PixelSampling::sobol ? Sampler::stratified(seed_, pixel, static_cast<std::uint32_t>(s))
                                                      : Sampler(seed_, pixel, static_cast<std::uint64_t>(s));
      const Ray ray = camera_.sample(x, y, rng);
      film_.add(x, y, integrator_.radiance(ray, rng, statistics));
    }
  }

  const RayCamera& camera_;
  const Integrator& integrator_;
  Film& film_;
  std::uint64_t seed_;
  PixelSampling sampling_;
  int columns_, tiles_;
};

// The number of samples of the next wave; 0 ends rendering. Waves double in size, so that results appear early and the
// overhead of later waves is small, up to a fraction of the budget that limits the effect of an inaccurate cost
// estimate.
class WavePlan {
 public:
  explicit WavePlan(const RenderOptions& options) : options_(options) {}

  int next(const RenderProgress& progress) const {
    if (progress.samples == 0) return 1;
    const double cost = std::max(progress.seconds / progress.samples, 1e-9);
    const double longest = options_.seconds ? *options_.seconds / kWavesPerBudget : kWaveSeconds;
    const double wanted = std::clamp(longest / cost, 1.0, static_cast<double>(progress.samples));
    return static_cast<int>(std::max(0.0, std::min(wanted, left(progress, cost))));
  }

 private:
  static constexpr double kWavesPerBudget = 20;
  static constexpr double kWaveSeconds = 2;

  double left(const RenderProgress& progress, double cost) const {
    if (options_.samples) return *options_.samples - progress.samples;
    // A sample that mostly fits is still rendered, so that the budget is met on average.
    return (*options_.seconds - progress.seconds) / cost + std::min(0.5, 0.01 * *options_.seconds / cost);
  }

  RenderOptions options_;
};

}  // namespace

void RenderOptions::validate() const {
  if (samples.has_value() == seconds.has_value())
    throw std::runtime_error("exactly one of samples and seconds must be given");
  if (samples && *samples < 1) throw std::runtime_error(fmt::format("samples per pixel: {} is not positive", *samples));
  if (firstSample < 0) throw std::runtime_error(fmt::format("first sample: {} is negative", firstSample));
  if (seconds && !(*seconds > 0.0)) throw std::runtime_error(fmt::format("seconds: {} is not positive", *seconds));
}

RenderResult render(const RayCamera& camera, const Integrator& integrator, Film& film, const RenderOptions& options,
                    const AfterWave& afterWave) {
  options.validate();
  const WaveRenderer renderer(camera, integrator, film, options);
  const WavePlan plan(options);
  RenderResult result{{}, {0.0, 0}};
  RenderProgress& progress = result.total;
  while (const int samples = plan.next(progress)) {
    const Stopwatch watch;
    const int first = options.firstSample + progress.samples;
    result.statistics += renderer.render({first, first + samples});
    progress.seconds += watch.seconds();
    progress.samples += samples;
    if (afterWave) afterWave(progress);
  }
  return result;
}

}  // namespace lobe
