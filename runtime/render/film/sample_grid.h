#pragma once
// One sample of an image at the points of a regular grid, and its convolution with the reconstruction filter.
//
// All points have the same offset o from the centre of their pixel. A point contributes to every pixel whose filter f
// covers it. With o sampled from the density S(o) = Σ_k f(k + o), which sums over all whole pixels k, and the weight
// f(k + o) / S(o) of the point of the pixel k steps away, the expected image is that of filter importance sampling. The
// weights sum to one, so that constant radiance has no noise, and the variance of independent noise is multiplied by
// the mean of their squares: 1/2.25 for a tent of radius 1, 1/3.1 for a Gaussian with a standard deviation of ½. In
// exchange, the errors of neighbouring pixels are correlated.

#include <vector>

#include "runtime/core/vec.h"
#include "runtime/render/film/camera.h"

namespace lobe {

/// The radiance at the points of the pixels of an image and of a border around it.
class SampleGrid {
 public:
  /// width, height: of the image in pixels.
  SampleGrid(int width, int height, int border)
      : border_(border),
        columns_(static_cast<std::size_t>(width) + 2 * static_cast<std::size_t>(border)),
        points_(columns_ * (static_cast<std::size_t>(height) + 2 * static_cast<std::size_t>(border))) {}

  /// x in [−border, width + border), and y likewise. May be called concurrently for different points.
  Rgb& at(int x, int y) { return points_[index(x, y)]; }
  const Rgb& at(int x, int y) const { return points_[index(x, y)]; }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + border_) * columns_ + static_cast<std::size_t>(x + border_);
  }

  int border_;
  std::size_t columns_;
  std::vector<Rgb> points_;
};

/// Convolves grids with a filter.
class GridFilter {
 public:
  /// How many points beyond each edge of an image contribute to its pixels; 0 for a box of one pixel, for which a grid
  /// has no advantage, and for filters with a radius of more than 16 pixels.
  static int border(const FilterSampler& filter);

  /// The variance of a pixel divided by that of a point, if the points are independent of each other; at most 1.
  static double relativeVariance(const FilterSampler& filter);

  /// Samples the offset of the points in [−½, ½]²; u uniform in [0, 1)².
  static Vec2 sampleOffset(const FilterSampler& filter, const Vec2& u);

  /// The filter must outlive this. width, height: of the image in pixels.
  GridFilter(int width, int height, const FilterSampler& filter);

  /// Convolves a grid of the filter's border, whose points have this offset, in parallel. Points that Film::add drops
  /// contribute nothing.
  void apply(const SampleGrid& grid, const Vec2& offset);

  /// The value of a pixel after apply; that of its own point if Film::add drops it.
  const Rgb& at(int x, int y) const { return image_.at(x, y); }

 private:
  /// The weights of the points −border, …, border of a row or column for the pixel at 0.
  static std::vector<float> weights(const FilterSampler& filter, float offset);

  const FilterSampler& filter_;
  int width_, height_, border_;
  SampleGrid rows_, image_;
};

}  // namespace lobe
