#pragma once
// PNG files, decoded by libpng.

#include <cstdint>
#include <optional>
#include <string_view>
#include <variant>
#include <vector>

namespace lobe {

bool startsLikePng(std::string_view bytes);

struct PngHeader {
  int width, height;
  int bitsPerPixel;  ///< in the file: of all components, or of the index of a colour
  bool hasAlpha;     ///< an alpha channel, or transparent colours
};

/// Throws std::runtime_error if a chunk before the pixels is damaged.
PngHeader headerOfPng(std::string_view bytes);

/// Red, green, blue and alpha, row by row from the top: 16-bit if the file is, and otherwise 8-bit. Without
/// transparency, alpha is the maximum.
using PngCodes = std::variant<std::vector<std::uint8_t>, std::vector<std::uint16_t>>;

/// The values as they are stored: not converted by the file's gamma or colour profile. Throws std::runtime_error if the
/// file is damaged or truncated, or std::bad_alloc.
PngCodes readPng(std::string_view bytes);

/// The exponent given by the gAMA chunk of a file that starts like a PNG; nullopt without such a chunk, or with an sRGB
/// chunk, which takes precedence.
std::optional<float> gammaOfPng(std::string_view bytes);

}  // namespace lobe
