#include "scenes/daylight/daylight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "runtime/core/colour.h"
#include "scenes/daylight/cie_tables.h"

namespace lobe {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kCandela = 1.0 / (683.0 * 106.856980);  // from cd/m² to W/(m² sr nm)

double zenithLuminanceOf(double turbidity, double sunAngle) {
  const double chi = (4.0 / 9.0 - turbidity / 120.0) * (std::numbers::pi - 2.0 * sunAngle);
  return 1000.0 * ((4.0453 * turbidity - 4.9710) * std::tan(chi) - 0.2155 * turbidity + 2.4192);
}

/// Cubic in the sun's angle, quadratic in the turbidity: the rows of m belong to T², T, 1, the columns to θ³, θ², θ, 1.
double zenithChromaticity(const Eigen::Matrix<double, 3, 4>& m, double turbidity, double sunAngle) {
  const double s = sunAngle;
  return Eigen::RowVector3d(turbidity * turbidity, turbidity, 1) * m * Eigen::Vector4d(s * s * s, s * s, s, 1);
}

Eigen::Matrix<double, 3, 4> zenithX() {
  Eigen::Matrix<double, 3, 4> m;
  m << 0.00166, -0.00375, 0.00209, 0, -0.02903, 0.06377, -0.03202, 0.00394, 0.11693, -0.21196, 0.06052, 0.25886;
  return m;
}
Eigen::Matrix<double, 3, 4> zenithY() {
  Eigen::Matrix<double, 3, 4> m;
  m << 0.00275, -0.00610, 0.00317, 0, -0.04214, 0.08970, -0.04153, 0.00516, 0.15346, -0.26756, 0.06670, 0.26688;
  return m;
}

/// A table is interpolated linearly and is 0 outside its range.
struct Sample {
  double wavelength;  // nm
  double value;
};
double interpolate(std::span<const Sample> table, double wavelength) {
  const auto above = std::ranges::upper_bound(table, wavelength, {}, &Sample::wavelength);
  if (above == table.begin()) return 0;
  const Sample& low = *(above - 1);
  if (above == table.end()) return wavelength == low.wavelength ? low.value : 0;
  const double t = (wavelength - low.wavelength) / (above->wavelength - low.wavelength);
  return low.value + t * (above->value - low.value);
}

// Solar spectral radiance outside the atmosphere, W/(m² sr nm), every 10 nm from 380 nm (the paper's table 2, with two
// digits more).
constexpr double kSunFirst = 380, kSunStep = 10;
constexpr std::array kSun = {16559.0, 16233.7, 21127.5, 25888.2, 25829.1, 24232.3, 26760.5, 29658.3, 30545.4, 30057.5,
                             30663.7, 28830.4, 28712.1, 27825.0, 27100.6, 27233.6, 26361.3, 25503.8, 25060.2, 25311.6,
                             25355.9, 25134.2, 24631.5, 24173.2, 23685.3, 23212.1, 22827.7, 22339.8, 21970.2, 21526.7,
                             21097.9, 20728.3, 20240.4, 19870.8, 19427.2, 19072.4, 18628.9, 18259.2};
constexpr double kSunLast = kSunFirst + kSunStep * (kSun.size() - 1);

double sunOutside(double wavelength) {
  const double at = (wavelength - kSunFirst) / kSunStep;
  const auto i = std::min(static_cast<std::size_t>(at), kSun.size() - 2);
  return std::lerp(kSun[i], kSun[i + 1], at - static_cast<double>(i));
}

// Absorption by ozone and water vapour, 1/cm (the same table); absorption by mixed gases begins where the sun's table
// ends.
constexpr Sample kOzone[] = {
    {355, 0.0},  {445, .003}, {450, .003}, {455, .004}, {460, .006}, {465, .008}, {470, .009}, {475, .012}, {480, .014},
    {485, .017}, {490, .021}, {495, .025}, {500, .03},  {505, .035}, {510, .04},  {515, .045}, {520, .048}, {525, .057},
    {530, .063}, {535, .07},  {540, .075}, {545, .08},  {550, .085}, {555, .095}, {560, .103}, {565, .110}, {570, .12},
    {575, .122}, {580, .12},  {585, .118}, {590, .115}, {595, .12},  {600, .125}, {605, .130}, {610, .12},  {620, .105},
    {630, .09},  {640, .079}, {650, .067}, {660, .057}, {670, .048}, {680, .036}, {690, .028}, {700, .023}, {710, .018},
    {720, .014}, {730, .011}, {740, .010}, {750, .009}, {760, .007}, {770, .004}, {780, 0.0},  {790, 0.0}};
constexpr Sample kWater[] = {{689, 0},   {690, 0.016}, {700, 0.024}, {710, 0.0125},
                             {720, 1.0}, {730, 0.87},  {740, 0.061}, {750, 0.001}};

/// Transmittance of the atmosphere at a wavelength in nm. airMass: relative to the path towards the zenith.
double transmittance(double turbidity, double airMass, double wavelength) {
  constexpr double kOzoneDepth = 0.35, kWaterDepth = 2;  // cm
  const double micrometres = wavelength / 1000;
  const double beta = 0.04608365822050 * turbidity - 0.04586025928522;
  const double water = interpolate(kWater, wavelength) * kWaterDepth * airMass;
  const double depth =
      airMass * 0.008735 * std::pow(micrometres, -4.08) + airMass * beta * std::pow(micrometres, -1.3) +
      airMass * interpolate(kOzone, wavelength) * kOzoneDepth + 0.2385 * water / std::pow(1 + 20.07 * water, 0.45);
  return std::exp(-depth);
}

}  // namespace

double PreethamSky::Perez::operator()(double cosine, double sunAngle, double sunCosine) const {
  return (1 + a * std::exp(b / cosine)) * (1 + c * std::exp(d * sunAngle) + e * sunCosine * sunCosine);
}

PreethamSky::Channel PreethamSky::channel(const Perez& perez, double zenith) const {
  const double up = std::clamp(sun_.y(), 0.0, 1.0);
  return {perez, zenith / perez(1, std::acos(up), up)};
}

PreethamSky::PreethamSky(double turbidity, const Eigen::Vector3d& sun) : sun_(sun) {
  const double t = turbidity;
  const double angle = std::acos(std::clamp(sun.y(), 0.0, 1.0));
  zenithLuminance_ = zenithLuminanceOf(t, angle);
  luminance_ = channel(
      {0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771, -0.0670 * t + 0.3703},
      zenithLuminance_);
  x_ = channel(
      {-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989, -0.0033 * t + 0.0452},
      zenithChromaticity(zenithX(), t, angle));
  y_ = channel(
      {-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537, -0.0109 * t + 0.0529},
      zenithChromaticity(zenithY(), t, angle));
}

Rgb PreethamSky::radiance(const Eigen::Vector3d& direction) const {
  const double cosine = direction.y();
  if (cosine <= 0) return Rgb::Zero();
  const double sunCosine = std::clamp(direction.dot(sun_), -1.0, 1.0);
  const double sunAngle = std::acos(sunCosine);
  const auto value = [&](const Channel& c) { return c.scale * c.perez(cosine, sunAngle, sunCosine); };
  const double luminance = value(luminance_) * kCandela, x = value(x_), y = value(y_);
  return rgbOfXyz({luminance * x / y, luminance, luminance * (1 - x - y) / y});
}

Rgb sunRadiance(double turbidity, double zenithAngle) {
  constexpr double kStep = 5;
  const double airMass =
      1 / (std::max(0.0, std::cos(zenithAngle)) + 0.15 * std::pow(93.885 - zenithAngle / kDegree, -1.253));
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  double white = 0;
  for (double nm = 360; nm <= 830; nm += kStep) {
    const Eigen::Vector3d response = colourMatching(nm);
    white += response.y();
    if (nm >= kSunFirst && nm <= kSunLast) xyz += response * (sunOutside(nm) * transmittance(turbidity, airMass, nm));
  }
  xyz /= white;
  return rgbOfXyz(xyz);
}

double sunRadius() {
  return 0.5 * 0.5358 * kDegree;
}

}  // namespace lobe
