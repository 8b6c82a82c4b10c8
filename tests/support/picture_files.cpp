#include "tests/support/picture_files.h"

#include <cstddef>
#include <stdexcept>

#ifndef __clang_analyzer__  // which reports code of the library
#define STB_IMAGE_WRITE_IMPLEMENTATION
#endif
#define STB_IMAGE_WRITE_STATIC
#include <stb/stb_image_write.h>

namespace lobe::test {
namespace {

constexpr int kChannels = 3, kJpegQuality = 90;

void append(void* bytes, void* data, int size) {
  static_cast<std::string*>(bytes)->append(static_cast<const char*>(data), static_cast<std::size_t>(size));
}

bool write(const std::string& type, int width, int height, const std::uint8_t* codes, std::string& bytes) {
  if (type == "png") return stbi_write_png_to_func(append, &bytes, width, height, kChannels, codes, kChannels * width);
  if (type == "bmp") return stbi_write_bmp_to_func(append, &bytes, width, height, kChannels, codes);
  if (type == "tga") return stbi_write_tga_to_func(append, &bytes, width, height, kChannels, codes);
  if (type == "jpg") return stbi_write_jpg_to_func(append, &bytes, width, height, kChannels, codes, kJpegQuality);
  return false;
}

}  // namespace

std::string pictureFile(const std::string& type, int width, int height, const std::vector<std::uint8_t>& codes) {
  std::string bytes;
  if (!write(type, width, height, codes.data(), bytes)) throw std::runtime_error("cannot write a file of type " + type);
  return bytes;
}

std::string hdrFile(int width, int height, const std::vector<float>& values) {
  std::string bytes;
  if (!stbi_write_hdr_to_func(append, &bytes, width, height, kChannels, values.data()))
    throw std::runtime_error("cannot write an HDR file");
  return bytes;
}

std::vector<std::uint8_t> noiseCodes(int width, int height) {
  std::vector<std::uint8_t> codes(std::size_t{kChannels} * static_cast<std::size_t>(width) *
                                  static_cast<std::size_t>(height));
  for (std::size_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<std::uint8_t>(i * i / 7);
  return codes;
}

}  // namespace lobe::test
