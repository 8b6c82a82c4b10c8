#pragma once
// Combines skies and suns into one environment map.

#include <vector>

#include "scenes/daylight/daylight.h"
#include "scenes/scene.h"

namespace lobe {

struct SkyDome {
  PreethamSky sky;
  Eigen::Matrix3d toWorld;  ///< rotation
  double scale;
  /// In [1, 2]: factor by which zenith angles are stretched, as in Mitsuba; 2 wraps the sky around the whole sphere.
  double stretch;
};

/// A disc of uniform radiance.
struct SunDisc {
  Eigen::Vector3d direction;  ///< unit, world space, towards the sun
  Rgb irradiance;             ///< on a surface that faces it; independent of the radius to first order
  double radius;              ///< radians, positive, at most π/2
};

struct DaylightParts {
  std::vector<SkyDome> skies;
  std::vector<SunDisc> suns;
};

/// The sum of all parts. With bilinear interpolation, the image has exactly the irradiance of each sun, in the pixels
/// around its disc. toWorld: from the frame of the image. width: in pixels, twice the height. Throws LoopCancelled in a
/// task that has been cancelled.
Environment bakeDaylight(const DaylightParts& parts, const Eigen::Matrix3d& toWorld, int width);

}  // namespace lobe
