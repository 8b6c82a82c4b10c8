#pragma once
// Squares of two textures in turn.

#include "materials/texture.h"

namespace lobe {

/// Two squares a unit in u and in v, as in Mitsuba 3: a where both coordinates of uv·uvScale + uvOffset lie in the same
/// half of their unit, b elsewhere. a and b themselves are looked up at the unscaled uv.
TexturePtr makeCheckerboard(TexturePtr a, TexturePtr b, Vec2 uvScale = {1, 1}, Vec2 uvOffset = {0, 0});

}  // namespace lobe
