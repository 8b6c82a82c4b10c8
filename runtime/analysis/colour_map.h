#pragma once
// Colour maps with perceptually uniform lightness, defined in Oklab (Ottosson 2020).

#include <array>

namespace lobe {

/// Red, green and blue in [0, 1], encoded as sRGB.
using Colour = std::array<float, 3>;

/// From dark violet over green to light yellow, with linearly increasing lightness. t is clamped to [0, 1].
Colour sequentialColour(double t);

/// Blue for negative t, white at 0, red for positive t; lightness depends on |t| only. t is clamped to [-1, 1].
Colour divergingColour(double t);

}  // namespace lobe
