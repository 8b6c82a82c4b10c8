#pragma once
// One sample of an image at the points of a regular grid, and its convolution with the reconstruction filter.
//
// All points have the same offset from the centre of their pixel, which is uniform in a pixel. A point contributes to
// every pixel whose filter covers it, with the filter's density as weight. The mean over the offset is the filtered
// image, so that the estimate is unbiased. Its variance is ∫f² times that of one point per pixel that is sampled from
// the filter f: 1/2.25 for a tent of radius 1, 1/3.1 for a Gaussian of standard deviation ½. In exchange, the errors of
// neighbouring pixels are correlated. Because the offset is the same everywhere, so is the sum of the weights, which is
// 1 for a tent: where the radiance is constant, the image has no noise.

#include <vector>

#include "runtime/core/vec.h"
#include "runtime/render/film/camera.h"

namespace lobe {

class SampleGrid {
 public:
  /// How many points beyond each edge of the image contribute to its pixels. 0 if no point contributes to more than one
  /// pixel, as with a box of one pixel; a grid has no advantage then.
  static int border(const FilterSampler& filter);

  /// The filter must outlive the grid. width, height: of the image in pixels.
  SampleGrid(int width, int height, const FilterSampler& filter);

  /// The radiance at the point of pixel (x, y); x in [−border, width + border), and y likewise. Called concurrently for
  /// different points.
  Rgb& at(int x, int y) { return points_[index(x, y)]; }

  /// Convolves the grid with the filter for points at an offset in [−½, ½)² from the centres of their pixels. Points
  /// that Film::add drops contribute nothing. In parallel.
  void convolve(const Vec2& offset);

  /// The filtered value of a pixel of the image after convolve; the value of its own point if Film::add drops that.
  const Rgb& filtered(int x, int y) const { return filtered_[index(x, y)]; }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + border_) * columns_ + static_cast<std::size_t>(x + border_);
  }
  /// The weights of the points −border, …, border of a row or column for the pixel at 0.
  std::vector<float> weights(float offset) const;

  const FilterSampler& filter_;
  int width_, height_, border_;
  std::size_t columns_;
  std::vector<Rgb> points_, rows_, filtered_;
};

}  // namespace lobe
