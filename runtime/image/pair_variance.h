#pragma once
// The variance of a method from two of its pictures, without a reference.

#include <cstdint>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

struct Interval {
  double low = 0, high = 0;
};

/// A mean over pixels with its 95 % confidence interval, which is NaN for images of fewer than two blocks.
struct MeanEstimate {
  double value = 0;
  Interval interval;
};

/// The relative variance of a pixel is the mean over its channels of ½(a − b)² / (m² + 0.01) with m = ½(a + b). If a
/// and b have the same expected value and independent noise, the numerator has the variance of either as its expected
/// value. The noise of m in the denominator is negligible if it is small; a pixel whose light has been found in one of
/// the two images only counts 2 at most, so rare outliers count less than against a reference.
///
/// The intervals are those of the bootstrap (percentiles of kBootstrapSamples resamples, Efron and Tibshirani 1993,
/// Chapter 13) that draws blocks of kBootstrapBlock × kBootstrapBlock pixels, because neighbouring pixels are
/// correlated if a sample contributes to several of them, or if the image is reconstructed from gradients. They are
/// conservative for one scene, because the parts of a picture differ more than the noise of each, but do not contain
/// what all pixels of a picture share, for example its training. Equal images give equal intervals.
struct PairVariance {
  MeanEstimate all;           ///< over all pixels
  MeanEstimate drop01;        ///< without the largest 0.1 % (rounded down)
  MeanEstimate drop1;         ///< without the largest 1 %
  double meanRatio = 0;       ///< mean(b) / mean(a); NaN if a is black
  std::size_t nonfinite = 0;  ///< pixels that are not finite in either image; they are excluded from all means
};

inline constexpr int kBootstrapBlock = 16;
inline constexpr int kBootstrapSamples = 1000;

/// Throws std::runtime_error if the sizes differ or there are no pixels.
PairVariance comparePair(const Image& a, const Image& b);

/// The relative variance of each pixel, row by row; NaN where a pixel is not finite. Throws like comparePair.
std::vector<float> relativeVariances(const Image& a, const Image& b);

}  // namespace lobe
