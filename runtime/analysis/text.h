#pragma once
// A small bitmap font of capitals, digits and punctuation, for captions.

#include <string_view>

#include "runtime/analysis/raster.h"

namespace lobe {

inline constexpr int kTextAdvance = 8, kTextHeight = 10;  ///< pixels per character

/// Draws one line of text with its top left corner at (x, y), clipped to the raster. Letters are drawn as capitals,
/// characters that the font lacks as blanks.
void drawText(Raster& raster, int x, int y, std::string_view text, const Colour& colour);

}  // namespace lobe
