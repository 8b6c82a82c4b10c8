#pragma once
// Creates PNG files with a few pixels byte by byte.

#include <cstdint>
#include <string>

namespace lobe {

inline std::string bigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
  return bytes;
}

/// The checksum is invalid, because our reader ignores it.
inline std::string chunk(const std::string& name, const std::string& data) {
  return bigEndian(static_cast<std::uint32_t>(data.size())) + name + data + "none";
}

/// One row of 8-bit pixels of three or four components.
inline std::string rowPng(const std::string& components, int perPixel, const std::string& chunks = "") {
  const std::string row = '\0' + components;  // no filter
  const auto low = static_cast<char>(row.size()), notLow = static_cast<char>(~row.size());
  const std::string stored = std::string("\x78\x01\x01", 3) + low + '\0' + notLow + '\xff' + row + "none";
  const std::string kind{'\x8', perPixel == 4 ? '\x6' : '\x2', '\0', '\0', '\0'};
  const auto width = static_cast<std::uint32_t>(components.size() / static_cast<std::size_t>(perPixel));
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", bigEndian(width) + bigEndian(1) + kind) + chunks + chunk("IDAT", stored) +
         chunk("IEND", "");
}

}  // namespace lobe
