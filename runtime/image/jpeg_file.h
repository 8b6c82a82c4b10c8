#pragma once
// JPEG files, decoded by libjpeg-turbo.

#include <cstdint>
#include <string_view>
#include <vector>

namespace lobe {

/// 8-bit red, green, blue and alpha, row by row from the top; alpha is 255.
struct JpegPixels {
  int width, height;
  std::vector<std::uint8_t> codes;
};

bool startsLikeJpeg(std::string_view bytes);

struct JpegSize {
  int width, height;
};

/// Throws std::runtime_error if the header is damaged.
JpegSize sizeOfJpeg(std::string_view bytes);

/// Throws std::runtime_error if the file is damaged or truncated or has more than 500 scans, which is how a small file
/// would take long; or std::bad_alloc.
JpegPixels readJpeg(std::string_view bytes);

}  // namespace lobe
