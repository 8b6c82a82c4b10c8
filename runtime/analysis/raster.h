#pragma once
// An 8-bit colour image in memory that can be written as a PNG.

#include <cstdint>
#include <filesystem>
#include <vector>

#include "runtime/analysis/colour_map.h"

namespace lobe {

/// 8-bit sRGB, row by row from the top.
class Raster {
 public:
  Raster(int width, int height, const Colour& background);
  int width() const { return width_; }
  int height() const { return height_; }
  Colour at(int x, int y) const;
  void set(int x, int y, const Colour& colour);
  /// Blends a colour over a pixel; `fraction` is its opacity.
  void blend(int x, int y, const Colour& colour, double fraction);

  /// Writes a PNG atomically. Throws std::runtime_error that names the file.
  void write(const std::filesystem::path& path) const;

 private:
  std::size_t offset(int x, int y) const { return 3 * (static_cast<std::size_t>(y) * width_ + x); }
  int width_, height_;
  std::vector<std::uint8_t> rgb_;
};

}  // namespace lobe
