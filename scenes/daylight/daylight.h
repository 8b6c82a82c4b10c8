#pragma once
// Clear sky and sun: Preetham, Shirley, Smits, "A Practical Analytic Model for Daylight" (SIGGRAPH 1999).
//
// Radiance is in W/(m² sr nm), the mean over the visible: luminance over 683 lm/W × ∫ȳ dλ = 106.857 nm. That is what
// Mitsuba's RGB sky has, and what the sun's spectrum comes to when it is weighted by ȳ. Colours are Rec. 709.

#include <Eigen/Core>

#include "runtime/core/vec.h"

namespace lobe {

/// The sky of section 3.2: Perez' five-parameter formula for luminance and chromaticity (appendix A.2).
class PreethamSky {
 public:
  /// What the fit holds for; below, its zenith would soon be black.
  static constexpr double kLowestTurbidity = 2;

  /// turbidity: from kLowestTurbidity to 10. sun: unit, towards it, not below the horizon; +y is up.
  PreethamSky(double turbidity, const Eigen::Vector3d& sun);

  /// From a unit direction above the horizon; black from any other.
  Rgb radiance(const Eigen::Vector3d& direction) const;
  /// The luminance of the zenith, cd/m² (appendix A.2).
  double zenithLuminance() const { return zenithLuminance_; }

 private:
  struct Perez {
    double a, b, c, d, e;
    double operator()(double cosine, double sunAngle, double sunCosine) const;
  };
  struct Channel {
    Perez perez;
    double scale;  // the zenith's value over the formula's there
  };
  Channel channel(const Perez& perez, double zenith) const;

  Eigen::Vector3d sun_;
  double zenithLuminance_;
  Channel luminance_, x_, y_;
};

/// The disc of the sun seen through the atmosphere (appendix A.1), at this angle from the zenith in radians, at most
/// π/2. turbidity: from 1 to 10.
Rgb sunRadiance(double turbidity, double zenithAngle);

/// Of the sun as it is, in radians: half of 0.5358° (Mitsuba's).
double sunRadius();

}  // namespace lobe
