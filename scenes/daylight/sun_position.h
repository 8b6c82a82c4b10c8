#pragma once
// Position of the sun by the PSA algorithm (Blanco-Muriel, Alarcón-Padilla, López-Moratalla, Lara-Coira: "Computing the
// solar vector", Solar Energy 70(5), 2001), accurate to about half an arc minute in the years 1999 to 2015 and slightly
// less accurate outside them.

#include <Eigen/Core>

namespace lobe {

/// Local time and place; the defaults are Mitsuba's.
struct DateAndPlace {
  int year = 2010, month = 7, day = 10;
  double hour = 15, minute = 0, second = 0;
  double timezone = 9;                              ///< hours east of Greenwich; there is no daylight saving time
  double latitude = 35.6894, longitude = 139.6917;  ///< degrees, north and east
};

/// The unit direction towards the sun: +y is up, +x east, −z north (Mitsuba's convention).
Eigen::Vector3d sunDirection(const DateAndPlace& when);

}  // namespace lobe
