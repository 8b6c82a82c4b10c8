#pragma once
// False-colour images of the error of each pixel.

#include <filesystem>
#include <span>

#include "runtime/image/image.h"

namespace lobe {

/// Range of relative errors that are shown, on a logarithmic scale: black at kMapLow, then blue, red and yellow, white
/// at kMapHigh.
inline constexpr float kMapLow = 1e-4f;
inline constexpr float kMapHigh = 1.0f;

/// Linear colour of a relative error (error_metrics.h) or variance (pair_variance.h); magenta for NaN.
Rgb errorColour(float relativeError);

/// Writes the colours of the errors of all pixels, row by row from the top, as a PNG of this width. Throws
/// std::runtime_error if the file cannot be written.
void writeErrorMap(const std::filesystem::path& path, int width, std::span<const float> errors);

}  // namespace lobe
