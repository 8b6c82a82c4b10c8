#pragma once
// Tables of the CIE standard observer and daylight illuminant.

#include <Eigen/Core>

namespace lobe {

/// Range of the tables in nm.
inline constexpr double kShortestWavelength = 360, kLongestWavelength = 830;

/// Colour matching functions x̄, ȳ, z̄ of the CIE 1931 observer (2°); zero outside the tables.
Eigen::Vector3d colourMatching(double wavelength);

/// Relative spectral power of illuminant D65 (daylight of 6504 K): 100 at 560 nm, zero outside the tables.
double daylight65(double wavelength);

}  // namespace lobe
