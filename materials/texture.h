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
  /// The linear colour at texture coordinates uv, which may be any real numbers; the wrap mode of the texture applies.
  /// v increases downwards from the first row of an image, as in Mitsuba; mesh readers convert their coordinates to
  /// this.
  virtual Rgb eval(const Vec2& uv) const = 0;
  /// The value as a number, such as a roughness: the luminance, unless the texture distinguishes numbers from colours.
  virtual float evalNumber(const Vec2& uv) const { return luminance(eval(uv)); }
  /// The mean colour over one period, used for decisions that must not depend on where the surface is hit.
  virtual Rgb mean() const = 0;
  /// Bounds of the luminance over all uv, tight except for coloured textures scaled by a colour; equal for a constant.
  virtual TextureRange range() const = 0;
  /// The maximum of each component over all uv; an upper bound for combined textures, otherwise exact.
  virtual Rgb largest() const = 0;
  /// The colour of a constant texture; nullopt for all other textures, even if all their values are equal.
  virtual std::optional<Rgb> constantColour() const { return std::nullopt; }
  /// Width and height in pixels. Only their ratio is used, as the aspect ratio of a projector's image.
  virtual std::array<int, 2> resolution() const { return {1, 1}; }
  /// Hash of everything eval depends on. Textures made from the same data have the same fingerprint in every run.
  virtual std::uint64_t fingerprint() const = 0;
};

using TexturePtr = std::shared_ptr<const Texture>;

/// The numbers (evalNumber) of a texture as grey colours, for use where colours are needed.
TexturePtr numbersOf(TexturePtr texture);

/// The texture times the scale.
TexturePtr scaledTexture(TexturePtr texture, const Rgb& scale);

/// The same colour everywhere.
TexturePtr constantTexture(const Rgb& colour);

}  // namespace lobe
