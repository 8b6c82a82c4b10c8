#pragma once
// Accumulates the samples of each pixel. Threads may write different pixels concurrently; results are reproducible bit
// by bit if the samples of each pixel are added in the same order.

#include <cstdint>
#include <utility>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

/// Whether all components are finite and not negative.
bool isUsableSample(const Rgb& sample);

class Film {
 public:
  /// The sums over the samples of a pixel.
  struct Pixel {
    double sum[3] = {0, 0, 0};
    double squares[3] = {0, 0, 0};
    std::uint32_t count = 0;
    std::uint32_t dropped = 0;

    /// All samples that add was called with.
    std::uint32_t samples() const { return count + dropped; }
  };

  Film(int width, int height) : width_(width), height_(height), pixels_(static_cast<std::size_t>(width) * height) {}
  /// pixels: width · height, row by row from the top.
  Film(int width, int height, std::vector<Pixel> pixels) : width_(width), height_(height), pixels_(std::move(pixels)) {}

  int width() const { return width_; }
  int height() const { return height_; }

  /// Samples with a negative or non-finite component are dropped and counted.
  void add(int x, int y, const Rgb& sample);

  /// The mean of the samples of each pixel; black for pixels without samples.
  Image mean() const;

  /// The variance of each pixel's mean, estimated from the differences among its samples: unbiased if they are
  /// independent, and too large on average if they are stratified. 0 for pixels with fewer than two samples.
  Image varianceOfMean() const;

  /// The number of samples that each mean is of, in all channels.
  Image counts() const;

  const Pixel& pixel(int x, int y) const { return pixels_[static_cast<std::size_t>(y) * width_ + x]; }
  const std::vector<Pixel>& pixels() const { return pixels_; }

  /// The smallest and the largest number of samples of a pixel.
  std::pair<std::uint32_t, std::uint32_t> sampleRange() const;

  /// The number of samples that add dropped.
  std::uint64_t dropped() const;

 private:
  template <class Value>
  Image map(const Value& value) const;

  int width_, height_;
  std::vector<Pixel> pixels_;
};

}  // namespace lobe
