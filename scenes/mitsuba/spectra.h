#pragma once
// Converts spectra to linear Rec. 709 colours with the CIE 1931 observer.

#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

/// Two or more increasing wavelengths in nm, each with its value.
using SpectrumPoints = std::vector<std::pair<double, double>>;

/// Parses text such as "400:0.78, 500:0.6"; nullopt if it has another form.
std::optional<SpectrumPoints> parseSpectrum(std::string_view text);
/// The same for the text of a file with two numbers per line and comments after a #.
std::optional<SpectrumPoints> parseSpectrumFile(std::string_view text);
/// Combines wavelengths with their values; nullopt when their numbers differ, there are fewer than two, or the
/// wavelengths do not increase.
std::optional<SpectrumPoints> spectrumOf(const std::vector<double>& wavelengths, const std::vector<double>& values);

/// How a spectrum is weighted. equalEnergy: not at all, as for emission, so that a constant spectrum of 1 has a
/// luminance of 1 and the colour (1.205, 0.948, 0.909). d65: by daylight, as for reflectance, so that a constant
/// reflectance of c is grey c.
enum class Illuminant { equalEnergy, d65 };

/// Interpolates linearly between the points; zero outside their range.
Rgb rgbOfSpectrum(const SpectrumPoints& points, Illuminant illuminant);

/// Radiance of a black body in W/(m² sr nm), equal to rgbOfSpectrum of points on its curve with
/// Illuminant::equalEnergy.
Rgb rgbOfBlackbody(double kelvin);

}  // namespace lobe
