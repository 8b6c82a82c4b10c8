#include "scenes/mitsuba/spectra.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "runtime/core/colour.h"
#include "scenes/daylight/cie_tables.h"
#include "scenes/mitsuba/values.h"

namespace lobe {
namespace {

constexpr double kStep = 1;  // of integrals over wavelengths, nm

template <class Spectrum>
Eigen::Vector3d integrate(const Spectrum& spectrum) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (double nm = kShortestWavelength; nm <= kLongestWavelength; nm += kStep)
    sum += kStep * spectrum(nm) * colourMatching(nm);
  return sum;
}

/// Normalised by the luminance of the equal-energy spectrum.
template <class Spectrum>
Rgb rgbOfEmission(const Spectrum& spectrum) {
  static const double kEqualEnergy = integrate([](double) { return 1.0; }).y();
  return rgbOfXyz(integrate(spectrum) / kEqualEnergy);
}

template <class Spectrum>
Rgb rgbOfReflectance(const Spectrum& spectrum) {
  static const Rgb kWhite = rgbOfXyz(integrate(daylight65));
  return rgbOfXyz(integrate([&](double nm) { return spectrum(nm) * daylight65(nm); })) / kWhite;
}

double valueAt(const SpectrumPoints& points, double nm) {
  const auto after = std::ranges::upper_bound(points, nm, {}, &SpectrumPoints::value_type::first);
  if (after == points.begin()) return 0.0;
  if (after == points.end()) return nm == points.back().first ? points.back().second : 0.0;
  const auto& [x0, y0] = *(after - 1);
  return std::lerp(y0, after->second, (nm - x0) / (after->first - x0));
}

/// From alternating wavelengths and values.
std::optional<SpectrumPoints> pairsOf(const std::vector<double>& numbers) {
  std::vector<double> wavelengths, values;
  for (std::size_t i = 0; i < numbers.size(); ++i) (i % 2 == 0 ? wavelengths : values).push_back(numbers[i]);
  return spectrumOf(wavelengths, values);
}

}  // namespace

std::optional<SpectrumPoints> spectrumOf(const std::vector<double>& wavelengths, const std::vector<double>& values) {
  if (wavelengths.size() < 2 || wavelengths.size() != values.size()) return std::nullopt;
  SpectrumPoints points;
  for (std::size_t i = 0; i < wavelengths.size(); ++i) {
    if (i > 0 && !(wavelengths[i] > wavelengths[i - 1])) return std::nullopt;
    points.emplace_back(wavelengths[i], values[i]);
  }
  return points;
}

std::optional<SpectrumPoints> parseSpectrum(std::string_view text) {
  std::string spaced(text);
  if (std::ranges::count(spaced, ':') == 0) return std::nullopt;
  std::ranges::replace(spaced, ':', ' ');
  const auto numbers = parseNumbers(spaced);
  return numbers ? pairsOf(*numbers) : std::nullopt;
}

std::optional<SpectrumPoints> parseSpectrumFile(std::string_view text) {
  std::string bare;
  bool comment = false;
  for (const char c : text) {
    comment = c == '#' || (comment && c != '\n');
    if (!comment) bare += c;
  }
  const auto numbers = parseNumbers(bare);
  return numbers ? pairsOf(*numbers) : std::nullopt;
}

Rgb rgbOfSpectrum(const SpectrumPoints& points, Illuminant illuminant) {
  const auto value = [&](double nm) { return valueAt(points, nm); };
  if (illuminant == Illuminant::equalEnergy) return rgbOfEmission(value);
  const Rgb colour = rgbOfReflectance(value);
  // A saturated spectrum with values of at most 1 may have colour components over 1.
  const bool reflectsAtMostAll = std::ranges::all_of(points, [](const auto& point) { return point.second <= 1.0; });
  return reflectsAtMostAll ? colour.min(1.0f).eval() : colour;
}

Rgb rgbOfBlackbody(double kelvin) {
  constexpr double kPlanck = 6.62607015e-34, kLight = 299792458.0, kBoltzmann = 1.380649e-23;
  const auto radiance = [&](double nm) {
    const double metres = 1e-9 * nm;
    const double exponent = kPlanck * kLight / (metres * kBoltzmann * kelvin);
    return 1e-9 * 2.0 * kPlanck * kLight * kLight / (std::pow(metres, 5) * std::expm1(exponent));
  };
  return rgbOfEmission(radiance);
}

}  // namespace lobe
