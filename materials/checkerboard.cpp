#include "materials/checkerboard.h"

#include <algorithm>
#include <cmath>

#include "materials/fingerprint.h"

namespace lobe {
namespace {

class CheckerboardTexture final : public Texture {
 public:
  CheckerboardTexture(TexturePtr a, TexturePtr b, const UvMap& uvMap)
      : a_(std::move(a)), b_(std::move(b)), uvMap_(uvMap) {}

  Rgb eval(const Vec2& uv) const override {
    const Vec2 st = uvMap_(uv);
    return (upperHalf(st.x()) == upperHalf(st.y()) ? a_ : b_)->eval(uv);
  }

  Rgb mean() const override { return 0.5f * (a_->mean() + b_->mean()); }
  TextureRange range() const override {
    const TextureRange a = a_->range(), b = b_->range();
    return {std::min(a.smallest, b.smallest), std::max(a.largest, b.largest)};
  }
  std::uint64_t fingerprint() const override {
    Fingerprint hash;
    hash.text("checkerboard");
    hash.number(a_->fingerprint());
    hash.number(b_->fingerprint());
    uvMap_.addTo(hash);
    return hash.value();
  }

 private:
  static bool upperHalf(float x) { return x - std::floor(x) > 0.5f; }

  TexturePtr a_, b_;
  UvMap uvMap_;
};

}  // namespace

TexturePtr makeCheckerboard(TexturePtr a, TexturePtr b, const UvMap& uvMap) {
  return std::make_shared<CheckerboardTexture>(std::move(a), std::move(b), uvMap);
}

}  // namespace lobe
