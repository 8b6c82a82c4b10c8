#pragma once
// A z-test over blocks of pixels for whether two images can be estimates of the same expected image.

#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "runtime/render/film/film.h"

namespace lobe::test {

struct Block {
  double mean = 0, variance = 0;
};

/// Means over blocks of pixels and channels, with the variances of these means. The pixels must be independent, as they
/// are with PixelFiltering::importance or a box.
inline std::vector<Block> blocks(const Film& film, int size) {
  const Image mean = film.mean(), variance = film.varianceOfMean();
  std::vector<Block> all;
  for (int y0 = 0; y0 + size <= film.height(); y0 += size)
    for (int x0 = 0; x0 + size <= film.width(); x0 += size) {
      Block block;
      for (int y = y0; y < y0 + size; ++y)
        for (int x = x0; x < x0 + size; ++x) {
          block.mean += mean.at(x, y).mean() / (size * size);
          // Channels are correlated: the standard deviation of their mean is at most the mean of their deviations.
          const double deviation = variance.at(x, y).sqrt().mean();
          block.variance += deviation * deviation / std::pow(size, 4);
        }
      all.push_back(block);
    }
  return all;
}

struct ZTest {
  double worst = 0;  ///< largest difference of a block, in standard deviations
  double p = 1;      ///< probability of such a difference in any of the blocks (Šidák's correction for their number)
  double together = 0;  ///< difference of the sums of all blocks, in standard deviations
  double ratio = 1;     ///< of the sums

  /// Whether neither any block differs significantly (level 0.1 %) nor the sum of all blocks.
  bool passes() const { return p > 0.001 && together < 3.3; }
};

/// Compares blocks of equal order. Blocks without variance must be equal.
inline ZTest zTest(const std::vector<Block>& a, const std::vector<Block>& b) {
  ZTest test;
  double sumA = 0, sumB = 0, variance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double v = a[i].variance + b[i].variance;
    const double difference = std::abs(a[i].mean - b[i].mean);
    if (difference > 0) test.worst = std::max(test.worst, difference / std::sqrt(v));
    sumA += a[i].mean;
    sumB += b[i].mean;
    variance += v;
  }
  test.together = sumA == sumB ? 0 : std::abs(sumA - sumB) / std::sqrt(variance);
  test.ratio = sumA / sumB;
  const double chance = std::erfc(test.worst / std::sqrt(2.0));  // of one block, two-sided
  test.p = -std::expm1(static_cast<double>(a.size()) * std::log1p(-chance));
  return test;
}

/// Whether a z-test passes.
inline bool agree(const std::vector<Block>& a, const std::vector<Block>& b) {
  const ZTest test = zTest(a, b);
  UNSCOPED_INFO("worst " << test.worst << " (p " << test.p << "), together " << test.together << ", ratio "
                         << test.ratio);
  return test.passes();
}

}  // namespace lobe::test
