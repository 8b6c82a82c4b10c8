#pragma once
// Writes images, and reads what they say of themselves.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

/// Attributes of an image file by name. The same image with the same attributes gives the same bytes, so what is to be
/// reproducible gets no times.
using ImageAttributes = std::map<std::string, std::variant<std::string, double>>;

/// Throws std::runtime_error unless the name ends in .exr or .png, so that a wrong one is found before hours of work.
void checkImageName(const std::filesystem::path& path);

/// Writes the whole file or none. .exr: 32-bit floating-point RGB, with the attributes; .png: 8-bit sRGB, clipped to
/// [0, 1], attributes ignored. Throws std::runtime_error that names the file.
void writeImage(const std::filesystem::path& path, const Image& image, const ImageAttributes& attributes = {});

/// The numbers and texts among the attributes of an .exr file; none of other
/// files. Throws std::runtime_error that names the file.
ImageAttributes readAttributes(const std::filesystem::path& path);

/// 8-bit RGB triples, row by row, as a PNG.
void writePng(const std::filesystem::path& path, int width, int height, const std::vector<std::uint8_t>& rgb);

}  // namespace lobe
