#include "runtime/render/integrators/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "runtime/core/parallel.h"
#include "runtime/core/stopwatch.h"
#include "runtime/render/film/sample_grid.h"

namespace lobe {
namespace {

constexpr int kTileSize = 16;
constexpr std::uint64_t kLightSeed = 0x6c69676874;        // keeps the random numbers of light paths apart
constexpr std::uint64_t kGridStream = ~std::uint64_t{0};  // of the offsets of sample grids; no pixel has this index
constexpr int kMostGrids = 16;                            // that are rendered at a time
constexpr std::size_t kMostGridPoints = std::size_t{1} << 23;  // of all of these, to bound their memory

/// A part of the samples of all pixels.
struct Wave {
  PathStatistics statistics;
  bool complete = true;
  std::vector<char> done = {};  ///< of each tile, whether it was rendered
};

/// The width of the border around the image in which samples are made; 0: every sample contributes to its pixel alone.
int borderOf(const RayCamera& camera, const RenderOptions& options) {
  if (options.filtering == PixelFiltering::importance) return 0;
  const int border = GridFilter::border(camera.filter());
  const double width = camera.width(), height = camera.height();
  // The border of a very small image takes more time than the lower variance is worth.
  const double points = (width + 2 * border) * (height + 2 * border);
  return points * GridFilter::relativeVariance(camera.filter()) < width * height ? border : 0;
}

/// Whether a pixel does not belong to the border.
bool isInImage(const RayCamera& camera, int x, int y) {
  return x >= 0 && y >= 0 && x < camera.width() && y < camera.height();
}

/// The offset of the points of sample s, counted from RenderOptions::firstSample, from the centres of their pixels.
Vec2 gridOffset(const RayCamera& camera, const RenderOptions& options, int s) {
  return GridFilter::sampleOffset(camera.filter(), options.sampler(kGridStream, s).stratified2());
}

/// The pixels of an image and of a border around it in tiles, with the random numbers of their samples.
class Tiles {
 public:
  Tiles(const RayCamera& camera, const RenderOptions& options, int border)
      : camera_(camera), options_(options), border_(border) {
    tileColumns_ = (columns() + kTileSize - 1) / kTileSize;
    count_ = tileColumns_ * ((rows() + kTileSize - 1) / kTileSize);
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
    for (const auto& statistics : perTile) {
      wave.done.push_back(statistics.has_value());
      if (statistics)
        wave.statistics += *statistics;
      else
        wave.complete = false;
    }
    return wave;
  }

  /// Whether a wave has rendered all points that contribute to a pixel of the image.
  bool areDoneAround(int x, int y, const Wave& wave) const {
    for (int row = y / kTileSize; row <= (y + 2 * border_) / kTileSize; ++row)
      for (int column = x / kTileSize; column <= (x + 2 * border_) / kTileSize; ++column)
        if (!wave.done[row * tileColumns_ + column]) return false;
    return true;
  }

  int border() const { return border_; }

  /// For sample s, counted from RenderOptions::firstSample.
  Sampler sampler(int x, int y, int s) const { return options_.sampler(pixelOf(x, y), s); }
  /// Independent numbers for the light path of the same sample.
  Sampler lightSampler(int x, int y, int s) const {
    return Sampler(options_.seed ^ kLightSeed, pixelOf(x, y), options_.indexOf(s));
  }
  std::uint64_t pixelOf(int x, int y) const {
    return static_cast<std::uint64_t>(y + border_) * columns() + static_cast<std::uint64_t>(x + border_);
  }

 private:
  template <class RenderPixel>
  void renderTile(int tile, PathStatistics& statistics, const RenderPixel& renderPixel) const {
    const int x0 = tile % tileColumns_ * kTileSize - border_;
    const int y0 = tile / tileColumns_ * kTileSize - border_;
    for (int y = y0; y < std::min(y0 + kTileSize, camera_.height() + border_); ++y)
      for (int x = x0; x < std::min(x0 + kTileSize, camera_.width() + border_); ++x)
        if (isInImage(camera_, x, y)) {
          renderPixel(x, y, tile, statistics);
        } else {
          // The image does not contain the border.
          PathStatistics ofBorder;
          renderPixel(x, y, tile, ofBorder);
          ofBorder.cut = {};
          ofBorder.largest = {};
          statistics += ofBorder;
        }
  }

  int columns() const { return camera_.width() + 2 * border_; }
  int rows() const { return camera_.height() + 2 * border_; }

  const RayCamera& camera_;
  const RenderOptions& options_;
  int border_, tileColumns_, count_;
};

bool isSet(const StopFlag* stop) {
  return stop && *stop != 0;
}

class WaveRenderer {
 public:
  WaveRenderer(const RayCamera& camera, const AddSample& addSample, const Film& film, const RenderOptions& options)
      : addSample_(addSample), film_(film), stop_(options.stop), tiles_(camera, options, 0) {}

  /// Adds to every pixel the samples that it lacks to have `samples` of them.
  void render(int samples, Wave& wave) {
    wave =
        tiles_.render([&] { return isSet(stop_); },
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

/// Renders a few samples of all pixels at a time, on grids. Pixel by pixel, because the samples of a pixel use the same
/// data.
class GridRenderer {
 public:
  GridRenderer(const RayCamera& camera, const Integrator& integrator, Film& film, const RenderOptions& options)
      : camera_(camera),
        integrator_(integrator),
        film_(film),
        options_(options),
        tiles_(camera, options, borderOf(camera, options)),
        filter_(camera.width(), camera.height(), camera.filter()) {}

  /// Adds to every pixel the samples that it lacks to have `samples` of them. The statistics are those of the samples
  /// that all pixels have in the end, because samples of which a part is missing are rendered again later.
  void render(int samples, Wave& wave) {
    for (int done = static_cast<int>(film_.sampleRange().first); done < samples && wave.complete;) {
      const int count = std::min(samples - done, mostGrids());
      const Wave part = renderGrids(done, count);
      for (int i = 0; i < count; ++i) addToFilm(grids_[i], done + i, part);
      wave.complete = part.complete;
      if (part.complete) wave.statistics += part.statistics;
      done += count;
    }
  }

 private:
  int mostGrids() const {
    return static_cast<int>(std::clamp<std::size_t>(kMostGridPoints / film_.pixels().size(), 1, kMostGrids));
  }

  Wave renderGrids(int first, int count) {
    while (static_cast<int>(grids_.size()) < count)
      grids_.emplace_back(camera_.width(), camera_.height(), tiles_.border());
    std::vector<Vec2> offsets;
    offsets.reserve(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) offsets.push_back(gridOffset(camera_, options_, first + i));
    return tiles_.render([&] { return isSet(options_.stop); },
                         [&](int x, int y, int, PathStatistics& statistics) {
                           for (int i = 0; i < count; ++i) {
                             Sampler rng = tiles_.sampler(x, y, first + i);
                             const Ray ray = camera_.rayThrough(x, y, camera_.sample(offsets[i], rng));
                             grids_[i].at(x, y) = integrator_.radiance(ray, rng, statistics);
                           }
                         });
  }

  /// Adds sample s to the pixels that lack it and for which all points of the grid have been rendered.
  void addToFilm(const SampleGrid& grid, int s, const Wave& wave) {
    filter_.apply(grid, gridOffset(camera_, options_, s));
    parallelFor(0, camera_.height(), [&](int y) {
      for (int x = 0; x < camera_.width(); ++x)
        if (static_cast<int>(film_.pixel(x, y).samples()) == s && tiles_.areDoneAround(x, y, wave))
          film_.add(x, y, filter_.at(x, y));
    });
  }

  const RayCamera& camera_;
  const Integrator& integrator_;
  Film& film_;
  const RenderOptions& options_;
  Tiles tiles_;
  GridFilter filter_;
  std::vector<SampleGrid> grids_;
};

/// Renders sample by sample, each of all pixels. A sample that is interrupted is discarded.
class ImageRenderer {
 public:
  ImageRenderer(const RayCamera& camera, const AddImageSample& addSample, const Film& film,
                const RenderOptions& options, int border)
      : camera_(camera), addSample_(addSample), film_(film), options_(options), tiles_(camera, options, border) {}

  /// Adds samples until every pixel has `samples` of them.
  void render(int samples, Wave& wave) {
    try {
      for (int s = static_cast<int>(film_.sampleRange().first); s < samples; ++s)
        wave.statistics += addSample_(OneSample(camera_, tiles_, options_, s));
    } catch (const Stopped&) {
      wave.complete = false;
    }
  }

 private:
  class OneSample : public ImageSample {
   public:
    OneSample(const RayCamera& camera, const Tiles& tiles, const RenderOptions& options, int sample)
        : camera_(camera), tiles_(tiles), options_(options), sample_(sample) {}
    int index() const override { return static_cast<int>(options_.indexOf(sample_)); }
    Vec2 offset() const override { return gridOffset(camera_, options_, sample_); }
    int tiles() const override { return tiles_.count(); }
    PathStatistics forEachPixel(const VisitPixel& visit) const override {
      const Wave wave = tiles_.render([&] { return isSet(options_.stop); },
                                      [&](int x, int y, int tile, PathStatistics& statistics) {
                                        Sampler rng = tiles_.sampler(x, y, sample_),
                                                lightRng = tiles_.lightSampler(x, y, sample_);
                                        visit(x, y, tile, rng, lightRng, statistics);
                                      });
      if (!wave.complete) throw Stopped("a sample of all pixels was interrupted");
      return wave.statistics;
    }

   private:
    const RayCamera& camera_;
    const Tiles& tiles_;
    const RenderOptions& options_;
    int sample_;
  };

  const RayCamera& camera_;
  const AddImageSample& addSample_;
  const Film& film_;
  const RenderOptions& options_;
  Tiles tiles_;
};

/// Adds samples of a bidirectional integrator to a film.
class BidirectionalSamples {
 public:
  BidirectionalSamples(const RayCamera& camera, BidirectionalIntegrator& integrator, Film& film, int border)
      : camera_(camera),
        integrator_(integrator),
        film_(film),
        fromCamera_(camera.width(), camera.height(), border),
        fromLights_(camera) {
    if (border > 0) filter_.emplace(camera.width(), camera.height(), camera.filter());
  }

  PathStatistics add(const ImageSample& sample) {
    splats_.resize(sample.tiles());
    for (std::vector<Splat>& list : splats_) list.clear();
    const Vec2 offset = sample.offset();
    PathStatistics statistics = storeLightPaths(sample);
    statistics +=
        sample.forEachPixel([&](int x, int y, int tile, Sampler& rng, Sampler& lightRng, PathStatistics& counts) {
          const CameraSample place = filter_ ? camera_.sample(offset, rng) : camera_.sample(rng);
          // The light image is of one light path per pixel; that of the border serves its camera path alone.
          std::vector<Splat>* const splats = isInImage(camera_, x, y) ? &splats_[tile] : nullptr;
          fromCamera_.at(x, y) = integrator_.radiance(camera_.rayThrough(x, y, place), rng, lightRng, counts, splats);
        });
    fromLights_.sum(splats_);
    if (filter_) filter_->apply(fromCamera_, offset);
    for (int y = 0; y < camera_.height(); ++y)
      for (int x = 0; x < camera_.width(); ++x)
        film_.add(x, y, (filter_ ? filter_->at(x, y) : fromCamera_.at(x, y)) + fromLights_.at(x, y));
    return statistics;
  }

 private:
  PathStatistics storeLightPaths(const ImageSample& sample) {
    if (!integrator_.storesLightPaths()) return {};
    integrator_.beginSample(sample.index());
    std::vector<std::vector<Photon>> perTile(sample.tiles());
    const PathStatistics statistics =
        sample.forEachPixel([&](int x, int y, int tile, Sampler&, Sampler& lightRng, PathStatistics& counts) {
          if (isInImage(camera_, x, y)) integrator_.storeLightPath(lightRng, counts, perTile[tile]);
        });
    std::vector<Photon> all;
    for (const std::vector<Photon>& photons : perTile) all.insert(all.end(), photons.begin(), photons.end());
    integrator_.mergeWith(all);
    return statistics;
  }

  const RayCamera& camera_;
  BidirectionalIntegrator& integrator_;
  Film& film_;
  SampleGrid fromCamera_;
  std::optional<GridFilter> filter_;  // if there is a border
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
    return static_cast<int>(std::max(0.0, std::min({wanted, left(progress, cost), room(progress)})));
  }

 private:
  static constexpr double kWavesPerBudget = 20;
  static constexpr double kWaveSeconds = 2;

  double left(const RenderProgress& progress, double cost) const {
    if (options_.samples) return *options_.samples - progress.samples;
    // A sample that mostly fits is still rendered, so that the budget is met on average.
    return (*options_.seconds - progress.seconds) / cost + std::min(0.5, 0.01 * *options_.seconds / cost);
  }

  // The number of further samples whose indices fit an int.
  double room(const RenderProgress& progress) const {
    return std::numeric_limits<int>::max() - options_.firstSample - progress.samples;
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

/// renderer.render adds its statistics to a wave. If it throws, those of the parts that were completed are in the wave.
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
    Wave wave;
    const auto addWave = [&] {
      result.statistics += wave.statistics;
      progress.seconds += watch.seconds();
      progress.samples = static_cast<int>(film.sampleRange().first);
    };
    try {
      renderer.render(progress.samples + samples, wave);
      if (options.withWave) options.withWave();
    } catch (...) {
      addWave();
      if (options.onFailure) options.onFailure(result);
      throw;
    }
    addWave();
    result.stopped = !wave.complete;
    if (result.stopped) break;
    if (afterWave) afterWave(result);
  }
  return result;
}

}  // namespace

RenderResult render(const RayCamera& camera, const Integrator& integrator, Film& film, const RenderOptions& options,
                    const AfterWave& afterWave, const RenderResult& before) {
  if (borderOf(camera, options) > 0) {
    options.validate();
    return renderWaves(GridRenderer(camera, integrator, film, options), film, options, afterWave, before);
  }
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
  return renderWaves(ImageRenderer(camera, addSample, film, options, 0), film, options, afterWave, before);
}

RenderResult render(const RayCamera& camera, BidirectionalIntegrator& integrator, Film& film,
                    const RenderOptions& options, const AfterWave& afterWave, const RenderResult& before) {
  options.validate();
  const int border = borderOf(camera, options);
  BidirectionalSamples samples(camera, integrator, film, border);
  const AddImageSample addSample = [&](const ImageSample& sample) { return samples.add(sample); };
  return renderWaves(ImageRenderer(camera, addSample, film, options, border), film, options, afterWave, before);
}

}  // namespace lobe
