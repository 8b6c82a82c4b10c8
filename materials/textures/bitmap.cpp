#include "materials/textures/bitmap.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "runtime/core/fingerprint.h"

namespace lobe {
namespace {

constexpr int kBlack = -1, kWhite = -2;

/// Maps any integer i to a pixel column or row, or to kBlack or kWhite outside the image.
int wrapIndex(long i, int size, Wrap mode) {
  if (mode == Wrap::zero || mode == Wrap::one) {
    if (i >= 0 && i < size) return static_cast<int>(i);
    return mode == Wrap::zero ? kBlack : kWhite;
  }
  if (mode == Wrap::clamp) return static_cast<int>(std::clamp(i, 0l, static_cast<long>(size) - 1));
  const long period = mode == Wrap::mirror ? 2l * size : size;
  long r = i % period;
  if (r < 0) r += period;
  return static_cast<int>(r < size ? r : period - 1 - r);
}

// Floats above this have no fractional part, and much larger ones would overflow in casts to integers.
constexpr float kLargestCoordinate = 1e7f;

Rgb meanOf(const Image& image) {
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  for (const Rgb& pixel : image.pixels) sum += pixel.cast<double>();
  return (sum / static_cast<double>(image.pixels.size())).cast<float>();
}

/// Bounds of the pixels' luminance, which interpolation does not exceed. NaN pixels are ignored.
TextureRange rangeOf(const Image& image) {
  TextureRange range{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  for (const Rgb& pixel : image.pixels) {
    range.smallest = std::min(range.smallest, luminance(pixel));
    range.largest = std::max(range.largest, luminance(pixel));
  }
  return range.smallest <= range.largest ? range : TextureRange{0.0f, 0.0f};
}

class BitmapTexture final : public Texture {
 public:
  BitmapTexture(std::shared_ptr<const Image> image, const BitmapOptions& options)
      : image_(std::move(image)), options_(options), mean_(meanOf(*image_)) {}

  Rgb eval(const Vec2& uv) const override {
    const Vec2 st = options_.uvMap(uv);
    const float x = st.x() * static_cast<float>(image_->width), y = st.y() * static_cast<float>(image_->height);
    // Negated, so that NaN returns the mean, too.
    if (!(std::abs(x) < kLargestCoordinate && std::abs(y) < kLargestCoordinate)) return mean_;
    return options_.nearest ? pixel(std::floor(x), std::floor(y)) : bilinear(x - 0.5f, y - 0.5f);
  }

  Rgb mean() const override { return mean_; }
  std::array<int, 2> resolution() const override { return {image_->width, image_->height}; }
  TextureRange range() const override {
    TextureRange range = rangeOf(*image_);
    if (uses(Wrap::zero)) range = {std::min(range.smallest, 0.0f), std::max(range.largest, 0.0f)};
    if (uses(Wrap::one)) range = {std::min(range.smallest, 1.0f), std::max(range.largest, 1.0f)};
    return range;
  }
  Rgb largest() const override {
    Rgb largest = image_->pixels.front();
    for (const Rgb& pixel : image_->pixels) largest = (pixel > largest).select(pixel, largest);
    if (uses(Wrap::zero)) largest = largest.max(0.0f);
    return uses(Wrap::one) ? Rgb(largest.max(1.0f)) : largest;
  }
  std::uint64_t fingerprint() const override {
    Fingerprint hash;
    hash.text("bitmap");
    addTo(hash, *image_);
    hash.number(options_.wrapU);
    hash.number(options_.wrapV);
    hash.number(options_.nearest);
    options_.uvMap.addTo(hash);
    return hash.value();
  }

 private:
  bool uses(Wrap mode) const { return options_.wrapU == mode || options_.wrapV == mode; }

  Rgb bilinear(float x, float y) const {
    const float x0 = std::floor(x), y0 = std::floor(y), fx = x - x0, fy = y - y0;
    const Rgb top = pixel(x0, y0) * (1 - fx) + pixel(x0 + 1, y0) * fx;
    const Rgb bottom = pixel(x0, y0 + 1) * (1 - fx) + pixel(x0 + 1, y0 + 1) * fx;
    return top * (1 - fy) + bottom * fy;
  }

  Rgb pixel(float x, float y) const {
    const int column = wrapIndex(static_cast<long>(x), image_->width, options_.wrapU);
    const int row = wrapIndex(static_cast<long>(y), image_->height, options_.wrapV);
    if (column < 0) return grey(column == kBlack ? 0.0f : 1.0f);
    if (row < 0) return grey(row == kBlack ? 0.0f : 1.0f);
    return image_->at(column, row);
  }

  std::shared_ptr<const Image> image_;
  BitmapOptions options_;
  Rgb mean_;
};

}  // namespace

TexturePtr makeBitmap(std::shared_ptr<const Image> image, const BitmapOptions& options) {
  if (!image || image->pixels.empty()) throw std::runtime_error("a bitmap texture needs an image with pixels");
  return std::make_shared<BitmapTexture>(std::move(image), options);
}

}  // namespace lobe
