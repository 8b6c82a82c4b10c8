#pragma once
// Creates PNG files with a few pixels byte by byte.

#include <cstdint>
#include <stdexcept>
#include <string>

#include <zlib.h>

namespace lobe {

inline std::string bigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
  return bytes;
}

inline const Bytef* zlibBytes(const std::string& bytes) {
  return reinterpret_cast<const Bytef*>(bytes.data());
}

inline std::string chunk(const std::string& name, const std::string& data) {
  const std::string content = name + data;
  const uLong checksum = crc32(0, zlibBytes(content), static_cast<uInt>(content.size()));
  return bigEndian(static_cast<std::uint32_t>(data.size())) + content + bigEndian(static_cast<std::uint32_t>(checksum));
}

inline std::string deflated(const std::string& data) {
  uLongf size = compressBound(data.size());
  std::string bytes(size, '\0');
  if (compress(reinterpret_cast<Bytef*>(bytes.data()), &size, zlibBytes(data), data.size()) != Z_OK)
    throw std::runtime_error("zlib cannot compress the rows of the image");
  bytes.resize(size);
  return bytes;
}

enum class PngColours : char { grey = 0, rgb = 2, palette = 3, greyAlpha = 4, rgba = 6 };

struct PngFormat {
  std::uint32_t width, height;
  int depth;
  PngColours colours;
  bool interlaced = false;
};

/// stream: the deflated rows, each after the number of its filter (0: none). chunks: those between header and pixels.
inline std::string pngFile(const PngFormat& format, const std::string& stream, const std::string& chunks = "") {
  const std::string kind{static_cast<char>(format.depth), static_cast<char>(format.colours), '\0', '\0',
                         static_cast<char>(format.interlaced)};
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", bigEndian(format.width) + bigEndian(format.height) + kind) + chunks +
         chunk("IDAT", stream) + chunk("IEND", "");
}

/// One row of 8-bit pixels of three or four components.
inline std::string rowPng(const std::string& components, int perPixel, const std::string& chunks = "") {
  const auto width = static_cast<std::uint32_t>(components.size() / static_cast<std::size_t>(perPixel));
  const PngColours colours = perPixel == 4 ? PngColours::rgba : PngColours::rgb;
  return pngFile({width, 1, 8, colours}, deflated('\0' + components), chunks);
}

}  // namespace lobe
