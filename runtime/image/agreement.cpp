#include "runtime/image/agreement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

namespace lobe {
namespace {

/// The mean of a block over all pictures of a method, the variance of that mean, and its degrees of freedom.
struct Estimate {
  double mean = 0, variance = 0, freedom = 0;
};

void check(std::span<const WeightedPicture> a, std::span<const WeightedPicture> b) {
  if (a.size() < 2 || b.size() < 2)
    throw std::runtime_error("the test of agreement needs at least two images of each method");
  if (a[0].image.pixels.empty()) throw std::runtime_error("the images have no pixels");
  for (const auto& pictures : {a, b})
    for (const WeightedPicture& picture : pictures) checkComparable(picture.image, a[0].image);
}

/// The sums of the channels of all pixels of each block, row by row; blocks at the border may be smaller.
std::vector<double> blockSums(const Image& image) {
  const int columns = (image.width + kAgreementBlock - 1) / kAgreementBlock;
  const int rows = (image.height + kAgreementBlock - 1) / kAgreementBlock;
  std::vector<double> sums(static_cast<std::size_t>(columns) * rows);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      sums[static_cast<std::size_t>(y / kAgreementBlock) * columns + x / kAgreementBlock] +=
          image.at(x, y).cast<double>().sum();
  return sums;
}

/// Picture i has the variance σ²/samples, so that the mean weighted by samples has the smallest variance.
Estimate estimate(std::span<const double> values, std::span<const WeightedPicture> pictures) {
  Estimate e{0, 0, static_cast<double>(values.size()) - 1};
  double samples = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    e.mean += pictures[i].samples * values[i];
    samples += pictures[i].samples;
  }
  e.mean /= samples;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double residual = values[i] - e.mean;
    e.variance += pictures[i].samples / samples * residual * residual / e.freedom;
  }
  return e;
}

/// The estimates of all blocks and, as the last, of the whole picture.
std::vector<Estimate> estimates(std::span<const WeightedPicture> pictures) {
  std::vector<std::vector<double>> sums;
  for (const WeightedPicture& picture : pictures) {
    sums.push_back(blockSums(picture.image));
    double whole = 0;
    for (const double sum : sums.back()) whole += sum;
    sums.back().push_back(whole);
  }
  std::vector<Estimate> all;
  std::vector<double> values(pictures.size());
  for (std::size_t block = 0; block < sums[0].size(); ++block) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = sums[i][block];
    all.push_back(estimate(values, pictures));
  }
  return all;
}

/// The normal deviate of the difference b − a. Estimates without variance must be equal.
double deviate(const Estimate& a, const Estimate& b) {
  const double difference = b.mean - a.mean, variance = a.variance + b.variance;
  if (difference == 0) return 0;
  if (!(variance > 0)) return std::copysign(std::numeric_limits<double>::infinity(), difference);
  const double freedom =
      variance * variance / (a.variance * a.variance / a.freedom + b.variance * b.variance / b.freedom);
  const double t2 = difference * difference / variance;
  const double z = (8 * freedom + 1) / (8 * freedom + 3) * std::sqrt(freedom * std::log1p(t2 / freedom));
  return std::copysign(z, difference);
}

/// The probability that a normal deviate is beyond ±z.
double twoSided(double z) {
  return std::erfc(std::abs(z) / std::sqrt(2.0));
}

/// The z with a two-sided probability, by bisection.
double deviateOf(double probability) {
  double low = 0, high = 40;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (twoSided(middle) > probability ? low : high) = middle;
  }
  return low;
}

}  // namespace

void checkComparable(const Image& image, const Image& first) {
  if (image.width != first.width || image.height != first.height)
    throw std::runtime_error(fmt::format("the image has {}x{} pixels, the first {}x{}", image.width, image.height,
                                         first.width, first.height));
  if (!std::ranges::all_of(image.pixels, [](const Rgb& p) { return p.allFinite(); }))
    throw std::runtime_error("the image has pixels that are not finite");
}

Agreement testAgreement(std::span<const WeightedPicture> a, std::span<const WeightedPicture> b) {
  check(a, b);
  const std::vector<Estimate> ofA = estimates(a), ofB = estimates(b);
  Agreement result;
  result.blocks = ofA.size() - 1;
  std::size_t worst = 0;
  for (std::size_t i = 0; i < result.blocks; ++i) {
    const double z = std::abs(deviate(ofA[i], ofB[i]));
    if (z > result.worstZ) result.worstZ = z, worst = i;
  }
  const int columns = (a[0].image.width + kAgreementBlock - 1) / kAgreementBlock;
  result.worstX = static_cast<int>(worst) % columns * kAgreementBlock;
  result.worstY = static_cast<int>(worst) / columns * kAgreementBlock;
  result.z = deviate(ofA.back(), ofB.back());
  const double level = -std::expm1(std::log1p(-kAgreementLevel) / static_cast<double>(result.blocks + 1));
  result.limitZ = deviateOf(level);
  result.agree = result.worstZ <= result.limitZ && std::abs(result.z) <= result.limitZ;
  const double mean = ofA.back().mean == 0 ? std::numeric_limits<double>::quiet_NaN() : ofA.back().mean;
  result.meanRatio = ofB.back().mean / mean;
  result.meanRatioError =
      std::sqrt(ofB.back().variance + result.meanRatio * result.meanRatio * ofA.back().variance) / mean;
  return result;
}

}  // namespace lobe
