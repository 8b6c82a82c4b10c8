#include "runtime/render/integrators/renderer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "runtime/core/parallel.h"
#include "runtime/core/stopwatch.h"

namespace lobe {
namespace {

constexpr int kTileSize = 16;

class WaveRenderer {
 public:
  WaveRenderer(const RayCamera& camera, const Integrator& integrator, Film& film, const RenderOptions& options)
      : camera_(camera), integrator_(integrator), film_(film), options_(options) {
    columns_ = (film.width() + kTileSize - 1) / kTileSize;
    tiles_ = columns_ * ((film.height() + kTileSize - 1) / kTileSize);
  }

  struct Wave {
    PathStatistics statistics;
    bool complete = true;
  };

  /// Adds to every pixel the samples that it lacks to have `samples` of them.
  Wave render(int samples) const {
    std::vector<std::optional<PathStatistics>> perTile(tiles_);
    parallelForEach(0, tiles_, [&](int tile) {
      if (!stopped()) perTile[tile] = renderTile(tile, samples);
    });
    Wave wave;
    for (const auto& statistics : perTile)
      if (statistics)
        wave.statistics += *statistics;
      else
        wave.complete = false;
    return wave;
  }

  bool stopped() const { return options_.stop && *options_.stop != 0; }

 private:
  PathStatistics renderTile(int tile, int samples) const {
    PathStatistics statistics;
    const int x0 = tile % columns_ * kTileSize;
    const int y0 = tile / columns_ * kTileSize;
    for (int y = y0; y < std::min(y0 + kTileSize, film_.height()); ++y)
      for (int x = x0; x < std::min(x0 + kTileSize, film_.width()); ++x) renderPixel(x, y, samples, statistics);
    return statistics;
  }

  void renderPixel(int x, int y, int samples, PathStatistics& statistics) const {
    const auto pixel = static_cast<std::uint64_t>(y) * film_.width() + x;
    for (int s = static_cast<int>(film_.pixel(x, y).samples()); s < samples; ++s) {
      const std::uint32_t index = static_cast<std::uint32_t>(options_.firstSample) + static_cast<std::uint32_t>(s);
      Sampler rng = options_.sampling == PixelSampling::sobol ? Sampler::stratified(options_.seed, pixel, index)
                                                              : Sampler(options_.seed, pixel, index);
      const Ray ray = camera_.sample(x, y, rng);
      film_.add(x, y, integrator_.radiance(ray, rng, statistics));
    }
  }

  const RayCamera& camera_;
  const Integrator& integrator_;
  Film& film_;
  const RenderOptions& options_;
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
    const double longest =
        std::min(options_.seconds ? *options_.seconds / kWavesPerBudget : kWaveSeconds, options_.longestWave);
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
                    const AfterWave& afterWave, const RenderResult& before) {
  options.validate();
  const WaveRenderer renderer(camera, integrator, film, options);
  const WavePlan plan(options);
  RenderResult result = before;
  RenderProgress& progress = result.total;
  progress.samples = static_cast<int>(film.sampleRange().first);
  result.stopped = false;
  while (const int samples = plan.next(progress)) {
    const Stopwatch watch;
    const WaveRenderer::Wave wave = renderer.render(progress.samples + samples);
    result.statistics += wave.statistics;
    progress.seconds += watch.seconds();
    result.stopped = !wave.complete;
    if (result.stopped) break;
    progress.samples += samples;
    if (afterWave) afterWave(result);
  }
  return result;
}

}  // namespace lobe
