#pragma once
// Sums of samples per pixel. Different pixels may be written by different threads; each pixel's samples have to come in
// the same order for the same bytes.

#include <cstdint>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

class Film {
 public:
  Film(int width, int height) : width_(width), height_(height), pixels_(static_cast<std::size_t>(width) * height) {}

  int width() const { return width_; }
  int height() const { return height_; }

  /// A sample with a component that is negative or not finite is dropped and counted, never averaged.
  void add(int x, int y, const Rgb& sample);

  /// Black where a pixel has no sample.
  Image mean() const;

  /// The variance of each pixel's mean, unbiased; infinite where a pixel has fewer than two samples.
  Image varianceOfMean() const;

  /// Samples that add dropped.
  std::uint64_t dropped() const;

 private:
  struct Pixel {
    double sum[3] = {0, 0, 0};
    double squares[3] = {0, 0, 0};
    std::uint32_t count = 0;
    std::uint32_t dropped = 0;
  };
  template <class Value>
  Image map(const Value& value) const;

  int width_, height_;
  std::vector<Pixel> pixels_;
};

}  // namespace lobe
