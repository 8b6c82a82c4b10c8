#pragma once
// A statistical test of whether the pictures of two methods have the same expected value.

#include <cstddef>
#include <span>

#include "runtime/image/image.h"

namespace lobe {

/// One of several independent pictures of a method, and its samples per pixel, which are its weight.
struct WeightedPicture {
  Image image;
  double samples = 1;
};

inline constexpr int kAgreementBlock = 8;         ///< pixels
inline constexpr double kAgreementLevel = 0.001;  ///< probability with which methods that agree fail the test

/// The test compares the means over blocks of kAgreementBlock × kAgreementBlock pixels and all channels, and those over
/// the whole picture. The variance of a mean is estimated from the pictures of its method, so that correlations between
/// pixels do not matter. Each difference is a Welch test: its t has the degrees of freedom of Welch and Satterthwaite,
/// and is transformed to a normal deviate z (Wallace 1959). The level is divided between the blocks by Šidák's
/// correction. A method that has not found any of a rare kind of light in all of its pictures has no variance from it,
/// and fails against one that has: such a failure says that the method needs more samples, not that it is wrong.
struct Agreement {
  bool agree = false;
  double meanRatio = 0;       ///< mean(b) / mean(a); NaN if a is black
  double meanRatioError = 0;  ///< its standard error; NaN if a is black
  double z = 0;               ///< of the whole picture, b − a
  double worstZ = 0;          ///< the largest |z| of a block; infinite if no picture varies
  double limitZ = 0;          ///< the largest |z| of a block that is accepted
  std::size_t blocks = 0;
  int worstX = 0, worstY = 0;  ///< the top left pixel of the worst block
};

/// Throws std::runtime_error if the image has another size than the first one or a pixel that is not finite.
void checkComparable(const Image& image, const Image& first);

/// a, b: the pictures of each method, at least two, with positive samples. Throws std::runtime_error if there are
/// fewer, sizes differ, there are no pixels, or one is not finite.
Agreement testAgreement(std::span<const WeightedPicture> a, std::span<const WeightedPicture> b);

}  // namespace lobe
