#include "runtime/render/film/film.h"

#include <algorithm>
#include <cmath>

namespace lobe {

bool isUsableSample(const Rgb& sample) {
  for (const float value : sample)
    if (!(value >= 0.0f) || !std::isfinite(value)) return false;
  return true;
}

void Film::add(int x, int y, const Rgb& sample) {
  Pixel& pixel = pixels_[static_cast<std::size_t>(y) * width_ + x];
  if (!isUsableSample(sample)) {
    ++pixel.dropped;
    return;
  }
  for (int c = 0; c < 3; ++c) {
    const double value = sample[c];
    pixel.sum[c] += value;
    pixel.squares[c] += value * value;
  }
  ++pixel.count;
}

template <class Value>
Image Film::map(const Value& value) const {
  Image image(width_, height_);
  for (std::size_t i = 0; i < pixels_.size(); ++i)
    for (int c = 0; c < 3; ++c) image.pixels[i][c] = static_cast<float>(value(pixels_[i], c));
  return image;
}

Image Film::mean() const {
  return map([](const Pixel& p, int c) { return p.count > 0 ? p.sum[c] / p.count : 0.0; });
}

Image Film::varianceOfMean() const {
  return map([](const Pixel& p, int c) {
    if (p.count < 2) return 0.0;
    const double n = p.count;
    return std::max(0.0, p.squares[c] - p.sum[c] * p.sum[c] / n) / (n * (n - 1.0));
  });
}

Image Film::counts() const {
  return map([](const Pixel& p, int) { return p.count; });
}

std::pair<std::uint32_t, std::uint32_t> Film::sampleRange() const {
  const auto [least, most] = std::ranges::minmax(pixels_, {}, &Pixel::samples);
  return {least.samples(), most.samples()};
}

std::uint64_t Film::dropped() const {
  std::uint64_t sum = 0;
  for (const Pixel& p : pixels_) sum += p.dropped;
  return sum;
}

}  // namespace lobe
