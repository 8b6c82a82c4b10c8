#pragma once
// Spectra as colours: linear Rec. 709, by the CIE 1931 observer.

#include <functional>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "materials/vec.h"

namespace lobe {

/// x̄, ȳ, z̄ at a wavelength in nm: the multi-lobe fit of Wyman, Sloan, Shirley 2013 (JCGT 2(2)).
Eigen::Vector3d colourMatching(double wavelength);

/// Without what is negative, which the primaries cannot show.
Rgb rgbOfXyz(const Eigen::Vector3d& xyz);

/// Wavelengths in nm, two or more and rising, each with its value.
using SpectrumPoints = std::vector<std::pair<double, double>>;

/// "400:0.78, 500:0.6": nullopt when it is anything else.
std::optional<SpectrumPoints> parseSpectrum(std::string_view text);
/// The same from a file of lines of two numbers, with comments after a #.
std::optional<SpectrumPoints> parseSpectrumFile(std::string_view text);

/// Linear between the points and zero beyond them. Channels are scaled so that equal energy is white: a spectrum that
/// is c wherever one can see is grey c. For reflectances, and for emission as far as it is meant to be white.
Rgb rgbOfSpectrum(const SpectrumPoints& points);

/// A black body's radiance in W/(m² sr nm), weighted by ȳ; its colour is the true one, white near 6500 K.
Rgb rgbOfBlackbody(double kelvin);

}  // namespace lobe
