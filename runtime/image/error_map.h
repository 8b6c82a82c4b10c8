#pragma once
// False-colour images of the error of each pixel.

#include <filesystem>

#include "runtime/image/image.h"

namespace lobe {

/// Range of relative errors that are shown, on a logarithmic scale: black at kMapLow, then blue, red and yellow, white
/// at kMapHigh.
inline constexpr float kMapLow = 1e-4f;
inline constexpr float kMapHigh = 1.0f;

/// Linear colour of a relative error as defined in error_metrics.h; magenta for NaN.
Rgb errorColour(float relativeError);

/// Writes the relative error of each pixel as a PNG. Throws std::runtime_error if the sizes differ or the file cannot
/// be written.
void writeErrorMap(const std::filesystem::path& path, const Image& reference, const Image& image);

}  // namespace lobe
