#include "materials/texture.h"
#include "runtime/core/fingerprint.h"

namespace lobe {
namespace {

class NumberTexture final : public Texture {
 public:
  explicit NumberTexture(TexturePtr nested) : nested_(std::move(nested)) {}
  Rgb eval(const Vec2& uv) const override { return grey(nested_->evalNumber(uv)); }
  Rgb mean() const override { return grey(luminance(nested_->mean())); }
  TextureRange range() const override { return nested_->range(); }
  Rgb largest() const override { return grey(nested_->range().largest); }
  std::array<int, 2> resolution() const override { return nested_->resolution(); }
  std::uint64_t fingerprint() const override {
    Fingerprint hash;
    hash.text("number");
    hash.number(nested_->fingerprint());
    return hash.value();
  }

 private:
  TexturePtr nested_;
};

}  // namespace

TexturePtr numbersOf(TexturePtr texture) {
  return std::make_shared<NumberTexture>(std::move(texture));
}

}  // namespace lobe
