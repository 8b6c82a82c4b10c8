#pragma once
// Pixels in memory, and reading them from files.

#include <filesystem>
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

/// Adds size and pixels.
void addTo(Fingerprint& hash, const Image& image);

/// How the numbers of an 8- or 16-bit file become linear: by the sRGB curve, as they are, by a power (gamma), or as the
/// file itself says (tagged: the gAMA chunk of a PNG that has no sRGB chunk; sRGB where there is nothing of the kind).
struct Encoding {
  enum class Kind { srgb, linear, gamma, tagged } kind = Kind::srgb;
  float exponent = 1.0f;
};

/// Reads PNG, JPEG, BMP, TGA (stb_image), HDR (rgbe_file.h) and EXR (OpenEXR; R, G, B or a single luminance channel Y;
/// the picture is the display window, black where the file has no pixels). Files with floating-point data are linear
/// whatever the encoding says. Alpha is dropped. Throws std::runtime_error that names the file and the fault.
Image readImage(const std::filesystem::path& path, Encoding encoding = {});

/// The alpha channel of such a file as grey: linear, from 0 to 1 where the file holds integers. Throws
/// std::runtime_error, also where there is no such channel.
Image readAlpha(const std::filesystem::path& path);

}  // namespace lobe
