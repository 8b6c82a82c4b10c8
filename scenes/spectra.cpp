#include "scenes/spectra.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "scenes/values.h"

namespace lobe {
namespace {

// What the eye sees of, and the step of sums over it, in nm.
constexpr double kShortest = 360, kLongest = 830, kStep = 1;

double bell(double wavelength, double peak, double below, double above) {
  const double t = (wavelength - peak) / (wavelength < peak ? below : above);
  return std::exp(-0.5 * t * t);
}

template <class Spectrum>
Eigen::Vector3d integrate(const Spectrum& spectrum) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (double nm = kShortest; nm <= kLongest; nm += kStep) sum += kStep * spectrum(nm) * colourMatching(nm);
  return sum;
}

const Eigen::Vector3d& equalEnergy() {
  static const Eigen::Vector3d kXyz = integrate([](double) { return 1.0; });
  return kXyz;
}

double valueAt(const SpectrumPoints& points, double nm) {
  const auto after = std::ranges::upper_bound(points, nm, {}, &SpectrumPoints::value_type::first);
  if (after == points.begin()) return 0.0;
  if (after == points.end()) return nm == points.back().first ? points.back().second : 0.0;
  const auto& [x0, y0] = *(after - 1);
  return std::lerp(y0, after->second, (nm - x0) / (after->first - x0));
}

std::optional<SpectrumPoints> risingPoints(const std::vector<double>& numbers) {
  if (numbers.size() < 4 || numbers.size() % 2 != 0) return std::nullopt;
  SpectrumPoints points;
  for (std::size_t i = 0; i < numbers.size(); i += 2) {
    if (!points.empty() && !(numbers[i] > points.back().first)) return std::nullopt;
    points.emplace_back(numbers[i], numbers[i + 1]);
  }
  return points;
}

}  // namespace

Eigen::Vector3d colourMatching(double nm) {
  return {
      1.056 * bell(nm, 599.8, 37.9, 31.0) + 0.362 * bell(nm, 442.0, 16.0, 26.7) - 0.065 * bell(nm, 501.1, 20.4, 26.2),
      0.821 * bell(nm, 568.8, 46.9, 40.5) + 0.286 * bell(nm, 530.9, 16.3, 31.1),
      1.217 * bell(nm, 437.0, 11.8, 36.0) + 0.681 * bell(nm, 459.0, 26.0, 13.8)};
}

Rgb rgbOfXyz(const Eigen::Vector3d& xyz) {
  const Eigen::Matrix3d toRgb{
      {3.240479, -1.537150, -0.498535}, {-0.969256, 1.875991, 0.041556}, {0.055648, -0.204043, 1.057311}};
  return (toRgb * xyz).cast<float>().array().max(0.0f);
}

std::optional<SpectrumPoints> parseSpectrum(std::string_view text) {
  std::string spaced(text);
  if (std::ranges::count(spaced, ':') == 0) return std::nullopt;
  std::ranges::replace(spaced, ':', ' ');
  const auto numbers = parseNumbers(spaced);
  return numbers ? risingPoints(*numbers) : std::nullopt;
}

std::optional<SpectrumPoints> parseSpectrumFile(std::string_view text) {
  std::string bare;
  bool comment = false;
  for (const char c : text) {
    comment = c == '#' || (comment && c != '\n');
    if (!comment) bare += c;
  }
  const auto numbers = parseNumbers(bare);
  return numbers ? risingPoints(*numbers) : std::nullopt;
}

Rgb rgbOfSpectrum(const SpectrumPoints& points) {
  return rgbOfXyz(integrate([&](double nm) { return valueAt(points, nm); })) / rgbOfXyz(equalEnergy());
}

Rgb rgbOfBlackbody(double kelvin) {
  constexpr double kPlanck = 6.62607015e-34, kLight = 299792458.0, kBoltzmann = 1.380649e-23;
  const auto radiance = [&](double nm) {
    const double metres = 1e-9 * nm;
    const double exponent = kPlanck * kLight / (metres * kBoltzmann * kelvin);
    return 1e-9 * 2.0 * kPlanck * kLight * kLight / (std::pow(metres, 5) * std::expm1(exponent));
  };
  return rgbOfXyz(integrate(radiance) / equalEnergy().y());
}

}  // namespace lobe
