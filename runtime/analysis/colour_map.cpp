#include "runtime/analysis/colour_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/core/colour.h"

namespace lobe {
namespace {

double cube(double x) {
  return x * x * x;
}

/// Oklab in polar form, hue in degrees.
Colour oklch(double lightness, double chroma, double hue) {
  const double a = chroma * std::cos(hue * std::numbers::pi / 180), b = chroma * std::sin(hue * std::numbers::pi / 180);
  const double l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
  const double m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
  const double s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
  const auto encoded = [](double linear) { return encodeSrgb(static_cast<float>(linear)); };
  return {encoded(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
          encoded(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
          encoded(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s)};
}

}  // namespace

Colour sequentialColour(double t) {
  const double x = std::clamp(t, 0.0, 1.0);
  // Chroma stays within the sRGB gamut, which allows more of it in the upper half; clipping would be visible as an
  // edge.
  const double upper = std::max(0.0, 2 * x - 1);
  return oklch(0.24 + 0.69 * x, 0.095 + 0.1 * upper * upper, 310 - 200 * x);
}

Colour divergingColour(double t) {
  const double distance = std::min(std::abs(t), 1.0);
  return oklch(0.97 - 0.5 * distance, 0.15 * distance, t < 0 ? 255 : 28);
}

}  // namespace lobe
