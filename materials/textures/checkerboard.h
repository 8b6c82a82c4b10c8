#pragma once
// A checkerboard of two textures.

#include "materials/texture.h"
#include "materials/textures/uv_map.h"

namespace lobe {

/// Which texture a square uses for evalNumber: the same as for colours, as in Mitsuba 0.6, or the other one, as in
/// Mitsuba 2 and 3.
enum class NumberSquares { asColours, exchanged };

/// Two squares per unit in u and in v, as in Mitsuba: a where the fractional parts of both mapped coordinates lie in
/// the same half of [0,1), b elsewhere. a and b themselves are evaluated at the unmapped uv.
TexturePtr makeCheckerboard(TexturePtr a, TexturePtr b, const UvMap& uvMap = {},
                            NumberSquares numbers = NumberSquares::asColours);

}  // namespace lobe
