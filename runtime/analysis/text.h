#pragma once
// A small font of capitals, digits and signs, for captions.

#include <string_view>

#include "runtime/analysis/raster.h"

namespace lobe {

inline constexpr int kTextAdvance = 8, kTextHeight = 10;  ///< pixels of a character

/// One line with its top left corner at (x, y). Letters become capitals; what the font lacks is a blank. What does not
/// fit into the raster is left out.
void drawText(Raster& raster, int x, int y, std::string_view text, const Colour& colour);

}  // namespace lobe
