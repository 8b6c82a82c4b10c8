#include "runtime/analysis/text.h"

#include <array>
#include <cctype>
#include <cstdint>
#include <utility>

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

namespace {

std::vector<std::string> split(std::string_view text, std::string_view separator) {
  std::vector<std::string> parts;
  for (std::size_t end = 0; end != std::string_view::npos;) {
    end = text.find(separator);
    if (end != 0 && !text.empty()) parts.emplace_back(text.substr(0, end));
    if (end != std::string_view::npos) text.remove_prefix(end + separator.size());
  }
  return parts;
}

/// Appends a part to the last line if it fits, otherwise as a new line.
void place(std::vector<std::string>& lines, const std::string& part, const char* separator, std::size_t columns) {
  const std::string joined = lines.empty() ? part : lines.back() + separator + part;
  if (!lines.empty() && joined.size() <= columns)
    lines.back() = joined;
  else
    lines.push_back(part);
}

}  // namespace

std::vector<std::string> wrapped(std::string_view text, std::size_t columns) {
  std::vector<std::string> lines;
  for (const std::string& phrase : split(text, "  ")) {
    if (phrase.size() <= columns) {
      place(lines, phrase, "  ", columns);
      continue;
    }
    const char* separator = "  ";
    for (const std::string& word : split(phrase, " ")) {
      for (std::size_t at = 0; at < word.size(); at += columns)
        place(lines, word.substr(at, columns), separator, columns);
      separator = " ";
    }
  }
  return lines;
}

std::string spelledOut(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 3> kNames{
      {{"α", "alpha"}, {"η", "eta"}, {"×", "x"}}};
  std::string result(text);
  for (const auto& [letter, name] : kNames)
    for (std::size_t at = 0; (at = result.find(letter, at)) != std::string::npos;)
      result.replace(at, letter.size(), name);
  return result;
}

}  // namespace lobe
