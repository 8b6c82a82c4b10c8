#include "runtime/image/pair_variance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/random.h"
#include "runtime/core/statistics.h"

namespace lobe {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<double, 3> kTrimmed{0, 0.001, 0.01};
using Means = std::array<double, kTrimmed.size()>;

float relativeVariance(const Rgb& a, const Rgb& b) {
  if (!a.allFinite() || !b.allFinite()) return std::numeric_limits<float>::quiet_NaN();
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    const double x = a[c], y = b[c], mean = 0.5 * (x + y);
    sum += 0.5 * (x - y) * (x - y) / (mean * mean + 0.01);
  }
  return static_cast<float>(sum / 3.0);
}

/// The finite pixels of an image, with the block of each.
class BlockedValues {
 public:
  BlockedValues(const std::vector<float>& values, int width, int height)
      : columns_((width + kBootstrapBlock - 1) / kBootstrapBlock),
        sums_(static_cast<std::size_t>(columns_) * ((height + kBootstrapBlock - 1) / kBootstrapBlock)),
        counts_(sums_.size()) {
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        if (const float value = values[static_cast<std::size_t>(y) * width + x]; !std::isnan(value)) add(value, x, y);
    std::ranges::sort(sorted_, std::greater(), &Pixel::value);
  }

  std::size_t blocks() const { return sums_.size(); }
  std::size_t pixels() const { return sorted_.size(); }

  /// The trimmed means of the image that has each block `copies` times. NaN if it has no pixels.
  Means means(const std::vector<int>& copies) const {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < copies.size(); ++i) {
      sum += copies[i] * sums_[i];
      count += copies[i] * counts_[i];
    }
    Means result{};
    double removed = 0;
    auto pixel = sorted_.begin();
    double copiesLeft = pixel == sorted_.end() ? 0 : copies[pixel->block];
    for (std::size_t i = 0; i < kTrimmed.size(); ++i) {
      const double target = std::floor(kTrimmed[i] * count);
      while (removed < target) {
        if (copiesLeft == 0) {
          copiesLeft = copies[(++pixel)->block];
          continue;
        }
        const double n = std::min(copiesLeft, target - removed);
        sum -= n * pixel->value;
        removed += n;
        copiesLeft -= n;
      }
      result[i] = count > 0 ? sum / (count - removed) : kNan;
    }
    return result;
  }

 private:
  struct Pixel {
    float value;
    std::uint32_t block;
  };

  void add(float value, int x, int y) {
    const std::size_t block = static_cast<std::size_t>(y / kBootstrapBlock) * columns_ + x / kBootstrapBlock;
    sums_[block] += value;
    counts_[block] += 1;
    sorted_.push_back({value, static_cast<std::uint32_t>(block)});
  }

  int columns_;
  std::vector<double> sums_, counts_;
  std::vector<Pixel> sorted_;  // from the largest to the smallest
};

std::array<Interval, kTrimmed.size()> bootstrap(const BlockedValues& values) {
  std::array<Interval, kTrimmed.size()> intervals;
  intervals.fill({kNan, kNan});
  if (values.blocks() < 2 || values.pixels() == 0) return intervals;
  Rng rng(0);
  std::array<std::vector<double>, kTrimmed.size()> resampled;
  for (int sample = 0; sample < kBootstrapSamples; ++sample) {
    std::vector<int> copies(values.blocks());
    for (std::size_t i = 0; i < copies.size(); ++i)
      ++copies[static_cast<std::size_t>(rng.uniformDouble() * static_cast<double>(copies.size()))];
    const Means means = values.means(copies);
    for (std::size_t i = 0; i < means.size(); ++i)
      if (!std::isnan(means[i])) resampled[i].push_back(means[i]);
  }
  for (std::size_t i = 0; i < intervals.size(); ++i)
    intervals[i] = {quantile(resampled[i], 0.025), quantile(resampled[i], 0.975)};
  return intervals;
}

double sumOf(const Image& image, const std::vector<float>& variances) {
  double sum = 0;
  for (std::size_t i = 0; i < variances.size(); ++i)
    if (!std::isnan(variances[i])) sum += image.pixels[i].cast<double>().sum();
  return sum;
}

}  // namespace

std::vector<float> relativeVariances(const Image& a, const Image& b) {
  if (a.width != b.width || a.height != b.height)
    throw std::runtime_error(
        fmt::format("the image has {}x{} pixels, the other {}x{}", b.width, b.height, a.width, a.height));
  if (a.pixels.empty()) throw std::runtime_error("the images have no pixels");
  std::vector<float> variances(a.pixels.size());
  std::ranges::transform(a.pixels, b.pixels, variances.begin(), relativeVariance);
  return variances;
}

PairVariance comparePair(const Image& a, const Image& b) {
  const std::vector<float> variances = relativeVariances(a, b);
  const BlockedValues values(variances, a.width, a.height);
  const Means means = values.means(std::vector<int>(values.blocks(), 1));
  const std::array<Interval, kTrimmed.size()> intervals = bootstrap(values);
  const double sum = sumOf(a, variances);
  return {{means[0], intervals[0]},
          {means[1], intervals[1]},
          {means[2], intervals[2]},
          sum == 0 ? kNan : sumOf(b, variances) / sum,
          variances.size() - values.pixels()};
}

}  // namespace lobe
