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
constexpr std::uint64_t kLightSeed = 0x6c69676874;  // keeps the random numbers of light paths apart

/// A part of the samples of all pixels.
struct Wave {
  PathStatistics statistics;
  bool complete = true;
};

/// The pixels of an image in tiles, with the random numbers of their samples.
class Tiles {
 public:
  Tiles(const RayCamera& camera, const RenderOptions& options) : camera_(camera), options_(options) {
    columns_ = (camera.width() + kTileSize - 1) / kTileSize;
    count_ = columns_ * ((camera.height() + kTileSize - 1) / kTileSize);
  }

  int count() const { return count_; }

  /// Calls renderPixel(x, y, tile, statistics) for all pixels, in parallel by tiles. Leaves out the tiles that have not
  /// begun when skip() returns true.
  template <class Skip, class RenderPixel>
  Wave render(const Skip& skip, const RenderPixel& renderPixel) const {
    std::vector<std::optional<PathStatistics>> perTile(count_);
    parallelForEach(0, count_, [&](int tile) {
      if (!skip()) renderTile(tile, perTile[tile].emplace(), renderPixel);
    });
    Wave wave;
    for (const auto& statistics : perTile)
      if (statistics)
        wave.statistics += *statistics;
      else
        wave.complete = false;
    return wave;
  }

  /// For sample s, counted from RenderOptions::firstSample.
  Sampler sampler(int x, int y, int s) const { return options_.sampler(pixelOf(x, y), s); }
  /// Independent numbers for the light path of the same sample.
  Sampler lightSampler(int x, int y, int s) const {
    return Sampler(options_.seed ^ kLightSeed, pixelOf(x, y), options_.indexOf(s));
  }
  int indexOf(int s) const { return static_cast<int>(options_.indexOf(s)); }
  std::uint64_t pixelOf(int x, int y) const { return static_cast<std::uint64_t>(y) * camera_.width() + x; }

 private:
  template <class RenderPixel>
  void renderTile(int tile, PathStatistics& statistics, const RenderPixel& renderPixel) const {
    const int x0 = tile % columns_ * kTileSize;
    const int y0 = tile / columns_ * kTileSize;
    for (int y = y0; y < std::min(y0 + kTileSize, camera_.height()); ++y)
      for (int x = x0; x < std::min(x0 + kTileSize, camera_.width()); ++x) renderPixel(x, y, tile, statistics);
  }

  const RayCamera& camera_;
  const RenderOptions& options_;
  int columns_, count_;
};

bool isSet(const StopFlag* stop) {
  return stop && *stop != 0;
}

class WaveRenderer {
 public:
  WaveRenderer(const RayCamera& camera, const AddSample& addSample, const Film& film, const RenderOptions& options)
      : addSample_(addSample), film_(film), stop_(options.stop), tiles_(camera, options) {}

  /// Adds to every pixel the samples that it lacks to have `samples` of them.
  Wave render(int samples) {
    return tiles_.render(
        [&] { return isSet(stop_); },
        [&](int x, int y, int, PathStatistics& statistics) { renderPixel(x, y, samples, statistics); });
  }

 private:
  void renderPixel(int x, int y, int samples, PathStatistics& statistics) const {
    for (int s = static_cast<int>(film_.pixel(x, y).samples()); s < samples; ++s) {
      Sampler rng = tiles_.sampler(x, y, s);
      addSample_(x, y, rng, statistics);
    }
  }

  const AddSample& addSample_;
  const Film& film_;
  const StopFlag* stop_;
  Tiles tiles_;
};

/// Renders sample by sample, each of all pixels.
class ImageRenderer {
 public:
  ImageRenderer(const RayCamera& camera, const AddImageSample& addSample, const Film& film,
                const RenderOptions& options)
      : addSample_(addSample), film_(film), stop_(options.stop), tiles_(camera, options) {}

  /// Adds samples until every pixel has `samples` of them.
  Wave render(int samples) {
    Wave wave;
    for (int s = static_cast<int>(film_.sampleRange().first); s < samples; ++s) {
      wave.complete = !isSet(stop_);
      if (!wave.complete) break;
      wave.statistics += addSample_(OneSample(tiles_, s));
    }
    return wave;
  }

 private:
  class OneSample : public ImageSample {
   public:
    OneSample(const Tiles& tiles, int sample) : tiles_(tiles), sample_(sample) {}
    int index() const override { return static_cast<int>(tiles_.indexOf(sample_)); }
    int tiles() const override { return tiles_.count(); }
    PathStatistics forEachPixel(const VisitPixel& visit) const override {
      return tiles_
          .render([] { return false; },
                  [&](int x, int y, int tile, PathStatistics& statistics) {
                    Sampler rng = tiles_.sampler(x, y, sample_), lightRng = tiles_.lightSampler(x, y, sample_);
                    visit(x, y, tile, rng, lightRng, statistics);
                  })
          .statistics;
    }

   private:
    const Tiles& tiles_;
    int sample_;
  };

  const AddImageSample& addSample_;
  const Film& film_;
  const StopFlag* stop_;
  Tiles tiles_;
};

/// Adds samples of a bidirectional integrator to a film.
class BidirectionalSamples {
 public:
  BidirectionalSamples(const RayCamera& camera, BidirectionalIntegrator& integrator, Film& film)
      : camera_(camera),
        integrator_(integrator),
        film_(film),
        fromCamera_(camera.width(), camera.height()),
        fromLights_(camera) {}

  PathStatistics add(const ImageSample& sample) {
    splats_.resize(sample.tiles());
    for (std::vector<Splat>& list : splats_) list.clear();
    PathStatistics statistics = storeLightPaths(sample);
    statistics +=
        sample.forEachPixel([&](int x, int y, int tile, Sampler& rng, Sampler& lightRng, PathStatistics& counts) {
          const Ray ray = camera_.sample(x, y, rng);
          fromCamera_.at(x, y) = integrator_.radiance(ray, rng, lightRng, counts, splats_[tile]);
        });
    fromLights_.sum(splats_);
    for (int y = 0; y < camera_.height(); ++y)
      for (int x = 0; x < camera_.width(); ++x) film_.add(x, y, fromCamera_.at(x, y) + fromLights_.at(x, y));
    return statistics;
  }

 private:
  PathStatistics storeLightPaths(const ImageSample& sample) {
    if (!integrator_.storesLightPaths()) return {};
    integrator_.beginSample(sample.index());
    std::vector<std::vector<Photon>> perTile(sample.tiles());
    const PathStatistics statistics =
        sample.forEachPixel([&](int, int, int tile, Sampler&, Sampler& lightRng, PathStatistics& counts) {
          integrator_.storeLightPath(lightRng, counts, perTile[tile]);
        });
    std::vector<Photon> all;
    for (const std::vector<Photon>& photons : perTile) all.insert(all.end(), photons.begin(), photons.end());
    integrator_.mergeWith(all);
    return statistics;
  }

  const RayCamera& camera_;
  BidirectionalIntegrator& integrator_;
  Film& film_;
  Image fromCamera_;
  LightImage fromLights_;
  std::vector<std::vector<Splat>> splats_;  // by tile
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

Sampler RenderOptions::sampler(std::uint64_t pixel, int s) const {
  return sampling == PixelSampling::sobol ? Sampler::stratified(seed, pixel, indexOf(s))
                                          : Sampler(seed, pixel, indexOf(s));
}

namespace {

template <class Renderer>
RenderResult renderWaves(Renderer renderer, const Film& film, const RenderOptions& options, const AfterWave& afterWave,
                         const RenderResult& before) {
  const WavePlan plan(options);
  RenderResult result = before;
  RenderProgress& progress = result.total;
  progress.samples = static_cast<int>(film.sampleRange().first);
  result.stopped = false;
  while (const int samples = plan.next(progress)) {
    const Stopwatch watch;
    const Wave wave = renderer.render(progress.samples + samples);
    if (options.withWave) options.withWave();
    result.statistics += wave.statistics;
    progress.seconds += watch.seconds();
    progress.samples = static_cast<int>(film.sampleRange().first);
    result.stopped = !wave.complete;
    if (result.stopped) break;
    if (afterWave) afterWave(result);
  }
  return result;
}

}  // namespace

RenderResult render(const RayCamera& camera, const Integrator& integrator, Film& film, const RenderOptions& options,
                    const AfterWave& afterWave, const RenderResult& before) {
  const AddSample addSample = [&](int x, int y, Sampler& rng, PathStatistics& statistics) {
    const Ray ray = camera.sample(x, y, rng);
    film.add(x, y, integrator.radiance(ray, rng, statistics));
  };
  return render(camera, addSample, film, options, afterWave, before);
}

RenderResult render(const RayCamera& camera, const AddSample& addSample, const Film& film, const RenderOptions& options,
                    const AfterWave& afterWave, const RenderResult& before) {
  options.validate();
  return renderWaves(WaveRenderer(camera, addSample, film, options), film, options, afterWave, before);
}

RenderResult render(const RayCamera& camera, const AddImageSample& addSample, const Film& film,
                    const RenderOptions& options, const AfterWave& afterWave, const RenderResult& before) {
  options.validate();
  return renderWaves(ImageRenderer(camera, addSample, film, options), film, options, afterWave, before);
}

RenderResult render(const RayCamera& camera, BidirectionalIntegrator& integrator, Film& film,
                    const RenderOptions& options, const AfterWave& afterWave, const RenderResult& before) {
  BidirectionalSamples samples(camera, integrator, film);
  const AddImageSample addSample = [&](const ImageSample& sample) { return samples.add(sample); };
  return render(camera, addSample, film, options, afterWave, before);
}

}  // namespace lobe
