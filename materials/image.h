#pragma once
// Pixels in memory, and reading them from files.

#include <filesystem>
#include <vector>

#include "materials/vec.h"

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

/// How the numbers of an 8- or 16-bit file become linear: by the sRGB curve, as they are, or by a power (gamma).
struct Encoding {
  enum class Kind { srgb, linear, gamma } kind = Kind::srgb;
  float exponent = 1.0f;
};

/// Reads PNG, JPEG, BMP, TGA, HDR (stb_image) and EXR (OpenEXR; R, G, B or a single luminance channel Y; the picture is
/// the display window, black where the file has no pixels). Files with floating-point data are linear whatever the
/// encoding says. Throws std::runtime_error that names the file and the fault.
Image readImage(const std::filesystem::path& path, Encoding encoding = {});

}  // namespace lobe
