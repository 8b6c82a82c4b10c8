#pragma once
// A colour that may vary over a surface.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "runtime/core/vec.h"

namespace lobe {

/// Bounds of a luminance.
struct TextureRange {
  float smallest, largest;
};

class Texture {
 public:
  virtual ~Texture() = default;
  /// The linear colour at texture coordinate uv: any real numbers, the texture wraps as it is set to. v counts
  /// downwards from an image's first row, as in Mitsuba; mesh readers hand out coordinates in this sense.
  virtual Rgb eval(const Vec2& uv) const = 0;
  /// The same where a number is asked for, such as a roughness: the luminance, unless the texture tells numbers from
  /// colours.
  virtual float evalNumber(const Vec2& uv) const { return luminance(eval(uv)); }
  /// The mean colour over one period, used for decisions that must not depend on where the surface is hit.
  virtual Rgb mean() const = 0;
  /// Bounds of the colour's luminance over all uv, tight but for coloured scales of colours; equal for a constant.
  virtual TextureRange range() const = 0;
  /// The largest value of each component over all uv; a bound where textures are combined, else exact.
  virtual Rgb largest() const = 0;
  /// The colour of a texture that is made to have only one; nullopt for any other.
  virtual std::optional<Rgb> constantColour() const { return std::nullopt; }
  /// Width and height in pixels, of which only the ratio counts: how wide a projector's picture is.
  virtual std::array<int, 2> resolution() const { return {1, 1}; }
  /// Of all that eval depends on: textures that look the same because they are made alike have the same on every run.
  virtual std::uint64_t fingerprint() const = 0;
};

using TexturePtr = std::shared_ptr<const Texture>;

/// Greys of the numbers that a texture has, for who asks for colours.
TexturePtr numbersOf(TexturePtr texture);

/// The texture times the scale.
TexturePtr scaledTexture(TexturePtr texture, const Rgb& scale);

/// The same colour everywhere.
TexturePtr constantTexture(const Rgb& colour);

}  // namespace lobe
