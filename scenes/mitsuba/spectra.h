#pragma once
// Spectra as colours: linear Rec. 709, by the CIE 1931 observer.

#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

/// Wavelengths in nm, two or more and rising, each with its value.
using SpectrumPoints = std::vector<std::pair<double, double>>;

/// "400:0.78, 500:0.6": nullopt when it is anything else.
std::optional<SpectrumPoints> parseSpectrum(std::string_view text);
/// The same from a file of lines of two numbers, with comments after a #.
std::optional<SpectrumPoints> parseSpectrumFile(std::string_view text);
/// Wavelengths and their values, both in order; nullopt when there are not as many of each, or not two, or the
/// wavelengths do not rise.
std::optional<SpectrumPoints> spectrumOf(const std::vector<double>& wavelengths, const std::vector<double>& values);

/// The light in which a spectrum is looked at: its own, so that equal energy of 1 at all wavelengths has a luminance of
/// 1 and the colour (1.205, 0.948, 0.909), or daylight (D65) that it reflects, so that a reflectance of c at all
/// wavelengths is grey c.
enum class Illuminant { equalEnergy, d65 };

/// Linear between the points and zero beyond them.
Rgb rgbOfSpectrum(const SpectrumPoints& points, Illuminant illuminant);

/// A black body's radiance in W/(m² sr nm), as that of points on its curve would be by Illuminant::equalEnergy.
Rgb rgbOfBlackbody(double kelvin);

}  // namespace lobe
