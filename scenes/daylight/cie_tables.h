#pragma once
// The CIE's standard observer and daylight, as tables.

#include <Eigen/Core>

namespace lobe {

/// What the tables hold, in nm.
inline constexpr double kShortestWavelength = 360, kLongestWavelength = 830;

/// x̄, ȳ, z̄ of the CIE 1931 observer (2°), zero beyond the tables.
Eigen::Vector3d colourMatching(double wavelength);

/// The relative power of daylight of 6504 K, illuminant D65: 100 at 560 nm, zero beyond the tables.
double daylight65(double wavelength);

}  // namespace lobe
