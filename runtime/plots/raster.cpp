#include "runtime/plots/raster.h"

#include <cmath>
#include <cstring>
#include <span>
#include <stdexcept>

#include "schema/atomic_file.h"

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#include <stb/stb_image_write.h>

namespace lobe {
namespace {

void appendBytes(void* context, void* data, int size) {
  auto& bytes = *static_cast<std::vector<std::byte>*>(context);
  const auto* first = static_cast<const std::byte*>(data);
  bytes.insert(bytes.end(), first, first + size);
}

}  // namespace

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

void Raster::blend(int x, int y, const Colour& colour, double share) {
  Colour mixed = at(x, y);
  for (std::size_t c = 0; c < 3; ++c) mixed[c] += static_cast<float>(share) * (colour[c] - mixed[c]);
  set(x, y, mixed);
}

void Raster::write(const std::filesystem::path& path) const {
  std::vector<std::byte> bytes;
  if (!stbi_write_png_to_func(appendBytes, &bytes, width_, height_, 3, rgb_.data(), 3 * width_))
    throw std::runtime_error(path.string() + ": the picture cannot be encoded as PNG");
  writeAtomically(path, std::span<const std::byte>(bytes));
}

}  // namespace lobe
