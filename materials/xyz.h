#pragma once
// Colours between the CIE's XYZ and linear Rec. 709.

#include <Eigen/Core>

#include "materials/vec.h"

namespace lobe {

/// Without what is negative, which the primaries cannot show.
inline Rgb rgbOfXyz(const Eigen::Vector3d& xyz) {
  const Eigen::Matrix3d toRgb{
      {3.240479, -1.537150, -0.498535}, {-0.969256, 1.875991, 0.041556}, {0.055648, -0.204043, 1.057311}};
  return (toRgb * xyz).cast<float>().array().max(0.0f);
}

}  // namespace lobe
