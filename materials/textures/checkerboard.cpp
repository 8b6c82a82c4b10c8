#include "materials/textures/checkerboard.h"

#include <algorithm>
#include <cmath>

#include "runtime/core/fingerprint.h"

namespace lobe {
namespace {

class CheckerboardTexture final : public Texture {
 public:
  CheckerboardTexture(TexturePtr a, TexturePtr b, const UvMap& uvMap, NumberSquares numbers)
      : a_(std::move(a)), b_(std::move(b)), uvMap_(uvMap), exchanged_(numbers == NumberSquares::exchanged) {}

  Rgb eval(const Vec2& uv) const override { return (inFirst(uv) ? a_ : b_)->eval(uv); }
  float evalNumber(const Vec2& uv) const override { return (inFirst(uv) != exchanged_ ? a_ : b_)->evalNumber(uv); }

  Rgb mean() const override { return 0.5f * (a_->mean() + b_->mean()); }
  TextureRange range() const override {
    const TextureRange a = a_->range(), b = b_->range();
    return {std::min(a.smallest, b.smallest), std::max(a.largest, b.largest)};
  }
  Rgb largest() const override { return a_->largest().max(b_->largest()); }
  std::uint64_t fingerprint() const override {
    Fingerprint hash;
    hash.text("checkerboard");
    hash.number(a_->fingerprint());
    hash.number(b_->fingerprint());
    uvMap_.addTo(hash);
    hash.number(exchanged_);
    return hash.value();
  }

 private:
  static bool upperHalf(float x) { return x - std::floor(x) > 0.5f; }
  bool inFirst(const Vec2& uv) const {
    const Vec2 st = uvMap_(uv);
    return upperHalf(st.x()) == upperHalf(st.y());
  }

  TexturePtr a_, b_;
  UvMap uvMap_;
  bool exchanged_;
};

}  // namespace

TexturePtr makeCheckerboard(TexturePtr a, TexturePtr b, const UvMap& uvMap, NumberSquares numbers) {
  return std::make_shared<CheckerboardTexture>(std::move(a), std::move(b), uvMap, numbers);
}

}  // namespace lobe
