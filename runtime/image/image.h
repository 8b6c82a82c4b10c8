#pragma once
// Images in memory, and readers for image files.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

/// Row-major RGB, first row on top.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<Rgb> pixels;

  Image() = default;
  Image(int w, int h, const Rgb& fill = Rgb::Zero())
      : width(w), height(h), pixels(static_cast<std::size_t>(w) * h, fill) {}
  Rgb& at(int x, int y) { return pixels[static_cast<std::size_t>(y) * width + x]; }
  const Rgb& at(int x, int y) const { return pixels[static_cast<std::size_t>(y) * width + x]; }
};

class Fingerprint;

/// Adds the size and the pixels to the hash.
void addTo(Fingerprint& hash, const Image& image);

/// Conversion of 8- and 16-bit values to linear ones: the sRGB curve, none (linear), a power (gamma), or as the file
/// specifies (tagged: the gAMA chunk of a PNG without sRGB chunk, otherwise sRGB).
struct Encoding {
  enum class Kind { srgb, linear, gamma, tagged } kind = Kind::srgb;
  float exponent = 1.0f;
};

/// Whether the content of the file is that of an EXR file, whatever its name. Throws std::runtime_error that names the
/// file if it is not a regular file or cannot be read.
bool isExrFile(const std::filesystem::path& path);

/// Reads PNG (png_file.h), JPEG (jpeg_file.h), BMP, TGA (stb_image), HDR (rgbe_file.h) and EXR (OpenEXR; R, G, B or a
/// single luminance channel Y). The image of an EXR file is the display window, black outside the data window; its
/// colours are converted to Rec. 709 if it has other chromaticities, and components that this makes negative are zero.
/// Floating-point data are linear whatever the encoding. Alpha is discarded. Throws std::runtime_error that names the
/// file and the fault.
Image readImage(const std::filesystem::path& path, Encoding encoding = {});

/// The alpha channel of a file as a grey image: linear, scaled to [0, 1] for integer formats. Throws std::runtime_error
/// like readImage, and if there is no alpha channel.
Image readAlpha(const std::filesystem::path& path);

/// Three channels of an .exr file, or one given three times, as they are stored. nullopt: the file lacks one of them,
/// or is not an .exr file. Throws std::runtime_error like readImage.
std::optional<Image> readChannels(const std::filesystem::path& path, const std::array<std::string, 3>& names);

}  // namespace lobe
