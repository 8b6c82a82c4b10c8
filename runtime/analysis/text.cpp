#include "runtime/analysis/text.h"

#include <cctype>
#include <cstdint>

namespace lobe {
namespace {

constexpr int kColumns = 3, kRows = 5, kScale = 2;

// Each octal digit is a row of three pixels, the first digit the top row.
constexpr std::uint16_t kDigits[] = {075557, 026227, 071747, 071717, 055711, 074717, 074757, 071222, 075757, 075717};
constexpr std::uint16_t kLetters[] = {025755, 065656, 034443, 065556, 074647, 074644, 034553, 055755, 072227,
                                      011152, 055655, 044447, 057755, 065555, 075557, 065644, 025573, 065655,
                                      034216, 072222, 055557, 055552, 055775, 055255, 055222, 071247};

std::uint16_t glyph(char c) {
  const auto u = static_cast<unsigned char>(c);
  if (std::isdigit(u)) return kDigits[u - '0'];
  if (std::isalpha(u) && u < 128) return kLetters[std::toupper(u) - 'A'];
  switch (c) {
    case '.':
      return 000002;
    case ',':
      return 000024;
    case ':':
      return 002020;
    case '-':
      return 000700;
    case '+':
      return 002720;
    case '%':
      return 051245;
    case '/':
      return 011244;
    case '(':
      return 012221;
    case ')':
      return 042224;
    case '=':
      return 007070;
    default:
      return 0;
  }
}

void drawSquare(Raster& raster, int left, int top, const Colour& colour) {
  for (int y = top; y < top + kScale; ++y)
    for (int x = left; x < left + kScale; ++x)
      if (x >= 0 && y >= 0 && x < raster.width() && y < raster.height()) raster.set(x, y, colour);
}

}  // namespace

void drawText(Raster& raster, int x, int y, std::string_view text, const Colour& colour) {
  for (const char c : text) {
    const std::uint16_t pixels = glyph(c);
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column)
        if (pixels >> (kColumns * (kRows - row) - 1 - column) & 1)
          drawSquare(raster, x + kScale * column, y + kScale * row, colour);
    x += kTextAdvance;
  }
}

}  // namespace lobe
