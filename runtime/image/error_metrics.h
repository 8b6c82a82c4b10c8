#pragma once
// Error of an image relative to a reference.

#include <cstddef>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

/// The relative error of a pixel is the mean over its channels of (x−r)²/(r²+0.01). Pixels that are not finite in
/// either image are excluded from all means and counted.
struct ErrorMetrics {
  double mse = 0;           ///< mean over pixels and channels of (x−r)²
  double relmse = 0;        ///< mean over pixels of the relative error
  double relmseDrop01 = 0;  ///< without the worst 0.1 % of pixels (rounded down)
  double relmseDrop1 = 0;   ///< without the worst 1 %
  double meanRatio = 0;     ///< mean(image) / mean(reference); NaN for a black reference
  std::size_t nonfinite = 0;
};

/// Throws std::runtime_error if the sizes differ or there are no pixels.
ErrorMetrics compareImages(const Image& reference, const Image& image);

/// Downsamples an image: each pixel is the mean of factor × factor pixels. Throws std::runtime_error unless factor ≥ 1
/// divides width and height.
Image averagedDown(const Image& image, int factor);

/// The relative error of each pixel, row by row; NaN where a pixel is not finite. Throws like compareImages.
std::vector<float> relativeErrors(const Image& reference, const Image& image);

}  // namespace lobe
