#pragma once
// Squares of two textures in turn.

#include "materials/texture.h"
#include "materials/textures/uv_map.h"

namespace lobe {

/// Which of the two textures of a checkerboard is where it is asked for numbers: the same as for colours, as in Mitsuba
/// 0.6, or the other one, as in Mitsuba 2 and 3.
enum class NumberSquares { asColours, exchanged };

/// Two squares a unit in u and in v, as in Mitsuba: a where both mapped coordinates lie in the same half of their unit,
/// b elsewhere. a and b themselves are looked up at the uv that comes in.
TexturePtr makeCheckerboard(TexturePtr a, TexturePtr b, const UvMap& uvMap = {},
                            NumberSquares numbers = NumberSquares::asColours);

}  // namespace lobe
