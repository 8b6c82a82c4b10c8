#pragma once
// Squares of two textures in turn.

#include "materials/texture.h"
#include "materials/uv_map.h"

namespace lobe {

/// Two squares a unit in u and in v, as in Mitsuba 3: a where both mapped coordinates lie in the same half of their
/// unit, b elsewhere. a and b themselves are looked up at the uv that comes in.
TexturePtr makeCheckerboard(TexturePtr a, TexturePtr b, const UvMap& uvMap = {});

}  // namespace lobe
