#include "runtime/image/error_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/image/image_output.h"

namespace lobe {

Rgb errorColour(float relativeError) {
  if (std::isnan(relativeError)) return {1.0f, 0.0f, 1.0f};
  static const std::array<Rgb, 5> kRamp{Rgb(0, 0, 0), Rgb(0.02f, 0.02f, 0.4f), Rgb(0.6f, 0.02f, 0.1f),
                                        Rgb(1.0f, 0.6f, 0.02f), Rgb(1, 1, 1)};
  const float decades = std::log10(std::max(relativeError, kMapLow) / kMapLow);
  const float position = std::min(decades / std::log10(kMapHigh / kMapLow), 1.0f) * (kRamp.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(position), kRamp.size() - 2);
  const float t = position - static_cast<float>(below);
  return (1.0f - t) * kRamp[below] + t * kRamp[below + 1];
}

void writeErrorMap(const std::filesystem::path& path, int width, std::span<const float> errors) {
  Image map(width, static_cast<int>(errors.size()) / width);
  std::transform(errors.begin(), errors.end(), map.pixels.begin(), errorColour);
  writeImage(path, map);
}

}  // namespace lobe
