#pragma once
// Conversions between CIE XYZ, linear Rec. 709 RGB and sRGB (transfer function of IEC 61966-2-1).

#include <cmath>

#include <Eigen/Core>

#include "runtime/core/vec.h"

namespace lobe {

/// Converts CIE XYZ to linear Rec. 709 RGB. Colours outside the gamut have negative components, which become zero.
inline Rgb rgbOfXyz(const Eigen::Vector3d& xyz) {
  const Eigen::Matrix3d toRgb{
      {3.240479, -1.537150, -0.498535}, {-0.969256, 1.875991, 0.041556}, {0.055648, -0.204043, 1.057311}};
  return (toRgb * xyz).cast<float>().array().max(0.0f);
}

/// Decodes an sRGB-encoded value to a linear one. Values outside [0, 1] are extrapolated.
inline float decodeSrgb(float encoded) {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}
inline Rgb decodeSrgb(const Rgb& encoded) {
  return encoded.unaryExpr([](float x) { return decodeSrgb(x); });
}

/// Encodes a linear value as sRGB. Values are clamped to [0, 1]; NaN gives 0.
inline float encodeSrgb(float linear) {
  if (!(linear > 0.0f)) return 0.0f;
  const float c = std::min(linear, 1.0f);
  return c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1.0f / 2.4f) - 0.055f;
}

}  // namespace lobe
