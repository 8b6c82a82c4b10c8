#include "runtime/analysis/raster.h"

#include <cmath>

#include "runtime/image/image_output.h"

namespace lobe {
Raster::Raster(int width, int height, const Colour& background)
    : width_(width), height_(height), rgb_(3 * static_cast<std::size_t>(width) * height) {
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) set(x, y, background);
}

Colour Raster::at(int x, int y) const {
  const std::uint8_t* p = &rgb_[offset(x, y)];
  return {p[0] / 255.0f, p[1] / 255.0f, p[2] / 255.0f};
}

void Raster::set(int x, int y, const Colour& colour) {
  for (std::size_t c = 0; c < 3; ++c) rgb_[offset(x, y) + c] = static_cast<std::uint8_t>(std::lround(255 * colour[c]));
}

void Raster::blend(int x, int y, const Colour& colour, double fraction) {
  Colour mixed = at(x, y);
  for (std::size_t c = 0; c < 3; ++c) mixed[c] += static_cast<float>(fraction) * (colour[c] - mixed[c]);
  set(x, y, mixed);
}

void Raster::write(const std::filesystem::path& path) const {
  writePng(path, width_, height_, rgb_);
}

}  // namespace lobe
