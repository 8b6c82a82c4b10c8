#include "scenes/daylight/sun_position.h"

#include <cmath>
#include <numbers>

namespace lobe {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

double hoursOfUniversalTime(const DateAndPlace& when) {
  return when.hour - when.timezone + (when.minute + when.second / 60) / 60;
}

/// Days since noon of 1 January 2000. The divisions are integer divisions that truncate towards zero; they count leap
/// days.
double daysSince2000(const DateAndPlace& when, double hours) {
  const int yearsBack = (when.month - 14) / 12;  // January and February belong to the year before
  const int days = 1461 * (when.year + 4800 + yearsBack) / 4 + 367 * (when.month - 2 - 12 * yearsBack) / 12 -
                   3 * ((when.year + 4900 + yearsBack) / 100) / 4 + when.day - 32075;
  return days - 0.5 + hours / 24 - 2451545;
}

struct Equatorial {
  double ascension, declination;
};

Equatorial sunAmongStars(double days) {
  const double node = 2.1429 - 0.0010394594 * days;
  const double anomaly = 6.2400600 + 0.0172019699 * days;
  const double longitude = 4.8950630 + 0.017202791698 * days + 0.03341607 * std::sin(anomaly) +
                           0.00034894 * std::sin(2 * anomaly) - 0.0001134 - 0.0000203 * std::sin(node);
  const double obliquity = 0.4090928 - 6.2140e-9 * days + 0.0000396 * std::cos(node);
  return {std::atan2(std::cos(obliquity) * std::sin(longitude), std::cos(longitude)),
          std::asin(std::sin(obliquity) * std::sin(longitude))};
}

}  // namespace

Eigen::Vector3d sunDirection(const DateAndPlace& when) {
  const double hours = hoursOfUniversalTime(when);
  const double days = daysSince2000(when, hours);
  const auto [ascension, declination] = sunAmongStars(days);
  const double siderealHours = 6.6974243242 + 0.0657098283 * days + hours;
  const double hourAngle = (15 * siderealHours + when.longitude) * kDegree - ascension;
  const double latitude = when.latitude * kDegree;

  const double up =
      std::cos(latitude) * std::cos(hourAngle) * std::cos(declination) + std::sin(declination) * std::sin(latitude);
  const double azimuth = std::atan2(
      -std::sin(hourAngle), std::tan(declination) * std::cos(latitude) - std::sin(latitude) * std::cos(hourAngle));
  // Parallax: seen from the ground instead of from the earth's centre.
  constexpr double kEarthRadius = 6371.01, kSunDistance = 149597890;
  const double fromZenith = std::acos(up);
  const double zenith = fromZenith + kEarthRadius / kSunDistance * std::sin(fromZenith);
  return {std::sin(azimuth) * std::sin(zenith), std::cos(zenith), -std::cos(azimuth) * std::sin(zenith)};
}

}  // namespace lobe
