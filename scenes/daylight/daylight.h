#pragma once
// Clear sky and sun: Preetham, Shirley, Smits, "A Practical Analytic Model for Daylight" (SIGGRAPH 1999).
//
// Radiance is in W/(m² sr nm), averaged over the visible range: the luminance divided by 683 lm/W × ∫ȳ dλ, where ∫ȳ dλ
// = 106.857 nm. Mitsuba's RGB sky has this unit, and so has the sun's spectrum after weighting by ȳ. Colours are Rec.
// 709.

#include <Eigen/Core>

#include "runtime/core/vec.h"

namespace lobe {

/// The sky of section 3.2: Perez' five-parameter formula for luminance and chromaticity (appendix A.2).
class PreethamSky {
 public:
  /// Lower limit of the model's validity; not far below it, the zenith becomes black.
  static constexpr double kLowestTurbidity = 2;

  /// turbidity: from kLowestTurbidity to 10. sun: unit direction towards the sun, not below the horizon; +y is up.
  PreethamSky(double turbidity, const Eigen::Vector3d& sun);

  /// Radiance from a unit direction; black at and below the horizon.
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
    double scale;  // value at the zenith divided by the formula's value there
  };
  Channel channel(const Perez& perez, double zenith) const;

  Eigen::Vector3d sun_;
  double zenithLuminance_;
  Channel luminance_, x_, y_;
};

/// Radiance of the sun's disc seen through the atmosphere (appendix A.1). turbidity: from 1 to 10. zenithAngle: in
/// radians, at most π/2.
Rgb sunRadiance(double turbidity, double zenithAngle);

/// Angular radius of the sun in radians: half of 0.5358°, as in Mitsuba.
double sunRadius();

}  // namespace lobe
