#pragma once
// Error of an image relative to a reference.

#include <cstddef>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

/// The fraction of the sum of the relative errors that the worst pixels have.
struct WorstPixels {
  double fraction001 = 0;  ///< of the worst 0.01 % of pixels (rounded up)
  double fraction01 = 0;   ///< of the worst 0.1 %
  double fraction1 = 0;    ///< of the worst 1 %
};

/// The relative error of a pixel is the mean over its channels of (x−r)²/(r²+0.01). Pixels that are not finite in
/// either image are excluded from all means and counted.
struct ErrorMetrics {
  double mse = 0;     ///< mean over pixels and channels of (x−r)²
  double relmse = 0;  ///< mean over pixels of the relative error
  /// The standard error of relmse, from the variance between blocks of kErrorBlock × kErrorBlock pixels. It is too low
  /// if the image has none of the rare outliers that make up much of the expected error. NaN for fewer than two blocks.
  double relmseError = 0;
  double relmseDrop01 = 0;  ///< without the worst 0.1 % of pixels (rounded down)
  double relmseDrop1 = 0;   ///< without the worst 1 %
  double meanRatio = 0;     ///< mean(image) / mean(reference); NaN for a black reference
  std::size_t nonfinite = 0;
  WorstPixels worst;
  /// Pixels whose luminance is more than kFirefly times the median over the surrounding 5×5 pixels, the reference at
  /// the pixel, and 1 % of the mean of the reference.
  std::size_t fireflies = 0;
};

inline constexpr int kErrorBlock = 8;
inline constexpr double kFirefly = 10;

/// Throws std::runtime_error if the sizes differ or there are no pixels.
ErrorMetrics compareImages(const Image& reference, const Image& image);

/// Downsamples an image: each pixel is the mean of factor × factor pixels. Throws std::runtime_error unless factor ≥ 1
/// divides width and height.
Image averagedDown(const Image& image, int factor);

/// The relative error of each pixel, row by row; NaN where a pixel is not finite. Throws like compareImages.
std::vector<float> relativeErrors(const Image& reference, const Image& image);

}  // namespace lobe
