#include "materials/texture.h"
#include "runtime/core/fingerprint.h"

namespace lobe {
namespace {

class ConstantTexture final : public Texture {
 public:
  explicit ConstantTexture(const Rgb& colour) : colour_(colour) {}
  Rgb eval(const Vec2&) const override { return colour_; }
  Rgb mean() const override { return colour_; }
  TextureRange range() const override { return {luminance(colour_), luminance(colour_)}; }
  Rgb largest() const override { return colour_; }
  std::optional<Rgb> constantColour() const override { return colour_; }
  std::uint64_t fingerprint() const override {
    Fingerprint hash;
    hash.text("constant");
    hash.coefficients(colour_);
    return hash.value();
  }

 private:
  Rgb colour_;
};

}  // namespace

TexturePtr constantTexture(const Rgb& colour) {
  return std::make_shared<ConstantTexture>(colour);
}

}  // namespace lobe
