#pragma once
// Errors as colours.

#include <filesystem>

#include "runtime/image/image.h"

namespace lobe {

/// Relative errors from kMapLow (black) over blue, red and yellow to kMapHigh (white), on a logarithmic scale.
inline constexpr float kMapLow = 1e-4f;
inline constexpr float kMapHigh = 1.0f;

/// The linear colour that stands for a relative error (error_metrics.h); magenta for NaN.
Rgb errorColour(float relativeError);

/// Writes the relative error of each pixel as a PNG. Throws std::runtime_error: sizes differ, or the file cannot be
/// written.
void writeErrorMap(const std::filesystem::path& path, const Image& reference, const Image& image);

}  // namespace lobe
