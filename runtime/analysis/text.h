#pragma once
// A small bitmap font of capitals, digits and punctuation, for captions.

#include <string>
#include <string_view>
#include <vector>

#include "runtime/analysis/raster.h"

namespace lobe {

inline constexpr int kTextAdvance = 8, kTextHeight = 10;  ///< pixels per character

/// Draws one line of text with its top left corner at (x, y), clipped to the raster. Letters are drawn as capitals,
/// characters that the font lacks as blanks.
void drawText(Raster& raster, int x, int y, std::string_view text, const Colour& colour);

/// Breaks text into lines of at most so many characters: preferably at double spaces, which separate phrases; within a
/// phrase that is longer than a line, at spaces; within a word that is, anywhere.
std::vector<std::string> wrapped(std::string_view text, std::size_t columns);

/// Spells out the letters of summaries that the font lacks: α, η and ×.
std::string spelledOut(std::string_view text);

}  // namespace lobe
