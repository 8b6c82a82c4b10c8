#include "runtime/image/error_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/colour.h"
#include "runtime/core/statistics.h"

namespace lobe {
namespace {

void checkSizes(const Image& reference, const Image& image) {
  if (reference.width != image.width || reference.height != image.height)
    throw std::runtime_error(fmt::format("the image has {}x{} pixels, the reference {}x{}", image.width, image.height,
                                         reference.width, reference.height));
  if (reference.pixels.empty()) throw std::runtime_error("the images have no pixels");
}

float relativeError(const Rgb& reference, const Rgb& value) {
  if (!reference.allFinite() || !value.allFinite()) return std::numeric_limits<float>::quiet_NaN();
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    const double r = reference[c];
    const double difference = value[c] - r;
    sum += difference * difference / (r * r + 0.01);
  }
  return static_cast<float>(sum / 3.0);
}

// Mean of the sorted values without the given fraction of largest ones.
double trimmedMean(const std::vector<float>& sorted, double fraction) {
  const std::size_t kept = sorted.size() - static_cast<std::size_t>(fraction * static_cast<double>(sorted.size()));
  double sum = 0;
  for (std::size_t i = 0; i < kept; ++i) sum += sorted[i];
  return kept > 0 ? sum / static_cast<double>(kept) : 0.0;
}

// The fraction of the sum of the sorted values that the given fraction of largest ones has.
double shareOfWorst(const std::vector<float>& sorted, double fraction) {
  const auto worst = static_cast<std::ptrdiff_t>(std::ceil(fraction * static_cast<double>(sorted.size())));
  const double sum = std::accumulate(sorted.begin(), sorted.end(), 0.0);
  return sum > 0 ? std::accumulate(sorted.end() - worst, sorted.end(), 0.0) / sum : 0.0;
}

// The standard error of the mean over all pixels that are not NaN. Blocks at the border count less, by their size.
double standardError(const std::vector<float>& errors, int width, int height) {
  struct Block {
    double sum = 0, count = 0;
  };
  const int columns = (width + kErrorBlock - 1) / kErrorBlock, rows = (height + kErrorBlock - 1) / kErrorBlock;
  std::vector<Block> blocks(static_cast<std::size_t>(columns) * rows);
  Block all;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double error = errors[static_cast<std::size_t>(y) * width + x];
      if (std::isnan(error)) continue;
      Block& block = blocks[static_cast<std::size_t>(y / kErrorBlock) * columns + x / kErrorBlock];
      block.sum += error, all.sum += error;
      block.count += 1, all.count += 1;
    }
  const auto n = static_cast<double>(blocks.size());
  if (n < 2 || all.count == 0) return std::numeric_limits<double>::quiet_NaN();
  double squares = 0;
  for (const Block& block : blocks) {
    const double residual = block.sum - block.count * all.sum / all.count;
    squares += residual * residual;
  }
  return std::sqrt(squares * n / (n - 1)) / all.count;
}

double finiteLuminance(const Rgb& c) {
  return c.allFinite() ? luminance(c) : 0.0;
}

// The median luminance of the 5×5 pixels around a pixel, without itself.
double medianAround(const Image& image, int x, int y) {
  std::vector<double> values;
  for (int j = std::max(0, y - 2); j <= std::min(image.height - 1, y + 2); ++j)
    for (int i = std::max(0, x - 2); i <= std::min(image.width - 1, x + 2); ++i)
      if (i != x || j != y) values.push_back(finiteLuminance(image.at(i, j)));
  return values.empty() ? 0.0 : median(values);
}

std::size_t countFireflies(const Image& reference, const Image& image) {
  double dark = 0;
  for (const Rgb& pixel : reference.pixels)
    dark += 0.01 * finiteLuminance(pixel) / static_cast<double>(reference.pixels.size());
  std::size_t count = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const double value = finiteLuminance(image.at(x, y)) / kFirefly;
      if (value > dark && value > finiteLuminance(reference.at(x, y)) && value > medianAround(image, x, y)) ++count;
    }
  return count;
}

double squaredDistance(const Rgb& a, const Rgb& b) {
  return (a.cast<double>() - b.cast<double>()).square().sum();
}

}  // namespace

Image averagedDown(const Image& image, int factor) {
  if (factor < 1 || image.width % factor != 0 || image.height % factor != 0)
    throw std::runtime_error(
        fmt::format("{0}x{1} pixels cannot be divided into blocks of {2}x{2}", image.width, image.height, factor));
  Image result(image.width / factor, image.height / factor);
  const float fraction = 1.0f / static_cast<float>(factor * factor);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) result.at(x / factor, y / factor) += fraction * image.at(x, y);
  return result;
}

std::vector<float> relativeErrors(const Image& reference, const Image& image) {
  checkSizes(reference, image);
  std::vector<float> errors(image.pixels.size());
  for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = relativeError(reference.pixels[i], image.pixels[i]);
  return errors;
}

ErrorMetrics compareImages(const Image& reference, const Image& image) {
  std::vector<float> errors = relativeErrors(reference, image);
  ErrorMetrics metrics;
  metrics.relmseError = standardError(errors, image.width, image.height);
  metrics.fireflies = countFireflies(reference, image);
  double squares = 0, sumImage = 0, sumReference = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (std::isnan(errors[i])) continue;
    squares += squaredDistance(image.pixels[i], reference.pixels[i]);
    sumImage += image.pixels[i].cast<double>().sum();
    sumReference += reference.pixels[i].cast<double>().sum();
  }
  std::erase_if(errors, [](float e) { return std::isnan(e); });
  std::sort(errors.begin(), errors.end());
  metrics.nonfinite = image.pixels.size() - errors.size();
  metrics.mse = errors.empty() ? 0.0 : squares / (3.0 * static_cast<double>(errors.size()));
  metrics.relmse = trimmedMean(errors, 0.0);
  metrics.relmseDrop01 = trimmedMean(errors, 0.001);
  metrics.relmseDrop1 = trimmedMean(errors, 0.01);
  metrics.worst = {shareOfWorst(errors, 0.0001), shareOfWorst(errors, 0.001), shareOfWorst(errors, 0.01)};
  metrics.meanRatio = sumReference == 0.0 ? std::numeric_limits<double>::quiet_NaN() : sumImage / sumReference;
  return metrics;
}

}  // namespace lobe
