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

/// Means over blocks of pixels and channels, with the variances of these means.
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

/// Whether neither any block differs significantly (level 0.1 % with Šidák's correction for the number of blocks) nor
/// the sum of all blocks. Blocks without variance must be equal.
inline bool agree(const std::vector<Block>& a, const std::vector<Block>& b) {
  double worst = 0, sumA = 0, sumB = 0, variance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double v = a[i].variance + b[i].variance;
    const double difference = std::abs(a[i].mean - b[i].mean);
    if (difference > 0) worst = std::max(worst, difference / std::sqrt(v));
    sumA += a[i].mean;
    sumB += b[i].mean;
    variance += v;
  }
  const double together = sumA == sumB ? 0 : std::abs(sumA - sumB) / std::sqrt(variance);
  const double chance = std::erfc(worst / std::sqrt(2.0));  // of one block, two-sided
  const double level = 1 - std::pow(1 - 0.001, 1.0 / static_cast<double>(a.size()));
  UNSCOPED_INFO("worst " << worst << ", together " << together << ", ratio " << sumA / sumB);
  return chance > level && together < 3.3;
}

}  // namespace lobe::test
