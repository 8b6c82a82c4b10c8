#pragma once
// Renders an image in waves of samples over all pixels, in parallel by tiles.

#include <cstdint>
#include <functional>
#include <optional>

#include "runtime/core/stop_flag.h"
#include "runtime/render/film/camera.h"
#include "runtime/render/film/film.h"
#include "runtime/render/integrators/integrator.h"

namespace lobe {

/// Where the random numbers of a pixel's samples come from: an Owen-scrambled Sobol' sequence for the film and the
/// first vertices (Sampler::stratified), or independent numbers.
enum class PixelSampling { sobol, independent };

/// How samples are weighted by the reconstruction filter. Both converge to the same image.
enum class PixelFiltering {
  /// A sample contributes to all pixels whose filter covers it (sample_grid.h), which lowers the noise. The widest
  /// filters, and images so small that their border would take more time than this is worth, use importance sampling.
  splatting,
  /// A sample contributes to one pixel, for which it is sampled from the filter, so that the noise of pixels is
  /// independent.
  importance
};

struct RenderResult;

/// Exactly one of samples and seconds is set.
struct RenderOptions {
  std::uint64_t seed = 1;
  std::optional<int> samples;  ///< per pixel: the same image for a seed, on any number of threads
  /// Stops when another wave would not fit, or where the indices of samples end; renders at least one sample per pixel.
  std::optional<double> seconds;
  PixelSampling sampling = PixelSampling::sobol;
  PixelFiltering filtering = PixelFiltering::splatting;
  int firstSample = 0;             ///< index of the first sample of every pixel; firstSample + samples must fit an int
  double longestWave = kInfinity;  ///< approximate limit in seconds of the time between calls of AfterWave
  const StopFlag* stop = nullptr;  ///< ends rendering after the current tiles when it is set
  /// Called after the samples of each wave, also of one that was stopped, while no thread writes to the film; empty:
  /// not used. Its time is part of the rendering time.
  std::function<void()> withWave = {};
  /// Called with the result so far if rendering fails, before the exception is passed on; empty: not used. Its
  /// statistics may lack those of the last samples of the film.
  std::function<void(const RenderResult&)> onFailure = {};

  /// The random numbers of sample s, counted from firstSample, of a pixel, counted row by row from the top; with
  /// splatting, among the pixels of the image and its border.
  Sampler sampler(std::uint64_t pixel, int s) const;
  /// The index of the sample s among all samples of its pixel.
  std::uint32_t indexOf(int s) const { return static_cast<std::uint32_t>(firstSample) + static_cast<std::uint32_t>(s); }
  /// Throws std::runtime_error that names the field.
  void validate() const;
};

struct RenderProgress {
  double seconds;  ///< rendering time so far, without the time spent in callbacks
  int samples;     ///< of every pixel so far
};

struct RenderResult {
  PathStatistics statistics;
  RenderProgress total{0.0, 0};
  bool stopped = false;  ///< ended early because of RenderOptions::stop; some pixels may have further samples
};

/// Adds one sample to the pixel (x, y) of a film. Called concurrently for different pixels.
using AddSample = std::function<void(int x, int y, Sampler& rng, PathStatistics& statistics)>;

/// One sample of every pixel, of an image whose samples are made together. With PixelFiltering::splatting, also one of
/// every pixel of a border around the image, with coordinates below 0 or from the size on.
class ImageSample {
 public:
  virtual ~ImageSample() = default;
  /// Its index, RenderOptions::firstSample included.
  virtual int index() const = 0;
  /// If there is a border, the offset of its points from the centres of their pixels.
  virtual Vec2 offset() const = 0;
  /// The number of tiles; the pixels of each are visited by one thread, in the same order on any number of threads.
  virtual int tiles() const = 0;
  /// Random numbers for the pixel's camera path, and independent ones for a light path.
  using VisitPixel =
      std::function<void(int x, int y, int tile, Sampler& rng, Sampler& lightRng, PathStatistics& statistics)>;
  /// Calls `visit` for all pixels and for those of the border, in parallel by tiles. Throws Stopped, which ends the
  /// sample, if RenderOptions::stop is set before all tiles have begun.
  virtual PathStatistics forEachPixel(const VisitPixel& visit) const = 0;
};

/// Adds one sample to every pixel of a film, or none if ImageSample throws.
using AddImageSample = std::function<PathStatistics(const ImageSample& sample)>;

/// Called after each wave, from the calling thread, while no thread writes to the film.
using AfterWave = std::function<void(const RenderResult&)>;

/// Adds samples to the film, which must have the size of the camera's image. Sample s of pixel i, counted from
/// firstSample, uses the random stream (seed, i, s). A film that already has samples is continued: each pixel gets the
/// samples that it lacks, so that the result has the same bytes as that of an uninterrupted run. `before` is the result
/// of the run that has filled the film.
RenderResult render(const RayCamera& camera, const Integrator& integrator, Film& film, const RenderOptions& options,
                    const AfterWave& afterWave = {}, const RenderResult& before = {});
/// The same for samples that are not only the radiance along a ray of their own pixel: addSample must add exactly one
/// sample to the film. RenderOptions::filtering is not used.
RenderResult render(const RayCamera& camera, const AddSample& addSample, const Film& film, const RenderOptions& options,
                    const AfterWave& afterWave = {}, const RenderResult& before = {});
/// The same for samples that are made for all pixels together, without a border: addSample must add exactly one sample
/// to each pixel of the film. A sample that is interrupted is discarded, so that all pixels have equally many; a film
/// that is continued must be like that.
RenderResult render(const RayCamera& camera, const AddImageSample& addSample, const Film& film,
                    const RenderOptions& options, const AfterWave& afterWave = {}, const RenderResult& before = {});
/// The same with light paths: sample s of pixel i is the radiance along its camera ray plus what the
/// light paths of sample s of all pixels contribute to it.
RenderResult render(const RayCamera& camera, BidirectionalIntegrator& integrator, Film& film,
                    const RenderOptions& options, const AfterWave& afterWave = {}, const RenderResult& before = {});

}  // namespace lobe
