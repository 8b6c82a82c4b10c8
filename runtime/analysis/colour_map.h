#pragma once
// Colours for numbers, along paths whose lightness is even to the eye: circles of hue in Oklab (Ottosson 2020).

#include <array>

namespace lobe {

/// Red, green and blue in [0, 1], encoded as sRGB.
using Colour = std::array<float, 3>;

/// From dark violet over green to light yellow, lightness rising linearly. t is clamped to [0, 1].
Colour sequentialColour(double t);

/// Blue below 0, white at 0, red above, equally light at equal distance. t is clamped to [-1, 1].
Colour divergingColour(double t);

}  // namespace lobe
