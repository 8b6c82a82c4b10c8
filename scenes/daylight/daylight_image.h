#pragma once
// Skies and suns as one environment image.

#include <vector>

#include "scenes/daylight/daylight.h"
#include "scenes/scene.h"

namespace lobe {

struct SkyDome {
  PreethamSky sky;
  Eigen::Matrix3d toWorld;  ///< rotation
  double scale;
  /// In [1, 2]: directions are seen this much further down from the zenith than they are, so that 2 wraps the sky
  /// around the whole sphere (Mitsuba's).
  double stretch;
};

/// A disc in the sky.
struct SunDisc {
  Eigen::Vector3d direction;  ///< unit, world space, towards it
  Rgb irradiance;             ///< on a surface that faces it, whatever its radius (at first order)
  double radius;              ///< radians, positive, at most π/2
};

struct DaylightParts {
  std::vector<SkyDome> skies;
  std::vector<SunDisc> suns;
};

/// The sum of all parts. Interpolated bilinearly, the image holds exactly each sun's irradiance, in the pixels around
/// its disc. toWorld: the frame that the image is in; width: in pixels, the height is half of that.
Environment bakeDaylight(const DaylightParts& parts, const Eigen::Matrix3d& toWorld, int width);

}  // namespace lobe
