#include <algorithm>

#include "materials/texture.h"
#include "runtime/core/fingerprint.h"

namespace lobe {
namespace {

class ScaledTexture final : public Texture {
 public:
  ScaledTexture(TexturePtr nested, const Rgb& scale) : nested_(std::move(nested)), scale_(scale) {}
  Rgb eval(const Vec2& uv) const override { return nested_->eval(uv) * scale_; }
  float evalNumber(const Vec2& uv) const override { return nested_->evalNumber(uv) * luminance(scale_); }
  Rgb mean() const override { return nested_->mean() * scale_; }
  TextureRange range() const override {
    const TextureRange nested = nested_->range();
    const float low = scale_.minCoeff(), high = scale_.maxCoeff();
    const auto [smallest, largest] =
        std::minmax({low * nested.smallest, low * nested.largest, high * nested.smallest, high * nested.largest});
    return {smallest, largest};
  }
  std::array<int, 2> resolution() const override { return nested_->resolution(); }
  Rgb largest() const override { return nested_->largest() * scale_; }
  std::uint64_t fingerprint() const override {
    Fingerprint hash;
    hash.text("scale");
    hash.number(nested_->fingerprint());
    hash.coefficients(scale_);
    return hash.value();
  }

 private:
  TexturePtr nested_;
  Rgb scale_;
};

}  // namespace

TexturePtr scaledTexture(TexturePtr texture, const Rgb& scale) {
  if (const std::optional<Rgb> constant = texture->constantColour()) return constantTexture(*constant * scale);
  return std::make_shared<ScaledTexture>(std::move(texture), scale);
}

}  // namespace lobe
