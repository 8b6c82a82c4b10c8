#pragma once
// A picture of coloured pixels in memory, and how it becomes a file.

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
  /// Mixes `share` of the colour into a pixel.
  void blend(int x, int y, const Colour& colour, double fraction);

  /// As a PNG, the whole file or none. Throws std::runtime_error that names the file.
  void write(const std::filesystem::path& path) const;

 private:
  std::size_t offset(int x, int y) const { return 3 * (static_cast<std::size_t>(y) * width_ + x); }
  int width_, height_;
  std::vector<std::uint8_t> rgb_;
};

}  // namespace lobe
