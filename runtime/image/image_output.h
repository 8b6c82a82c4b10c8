#pragma once
// Writes images, and reads the attributes of image files.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "runtime/image/image.h"

namespace lobe {

/// Attributes of an image file by name. Equal images with equal attributes give identical files, so reproducible files
/// must not contain times.
using ImageAttributes = std::map<std::string, std::variant<std::string, double>>;

/// Throws std::runtime_error unless the name ends in .exr or .png. Called before rendering, so that a wrong name is
/// found early.
void checkImageName(const std::filesystem::path& path);

/// Writes the file atomically. .exr: 32-bit floating-point RGB with the attributes; .png: 8-bit sRGB, clipped to
/// [0, 1], without the attributes. Throws std::runtime_error that names the file.
void writeImage(const std::filesystem::path& path, const Image& image, const ImageAttributes& attributes = {});

/// The attributes of type double and string of an .exr file; empty for other files. Throws std::runtime_error that
/// names the file.
ImageAttributes readAttributes(const std::filesystem::path& path);

/// Writes 8-bit RGB triples, row by row from the top, as a PNG. Throws like writeImage.
void writePng(const std::filesystem::path& path, int width, int height, const std::vector<std::uint8_t>& rgb);

}  // namespace lobe
