#pragma once
// Short names for Eigen's vector types, and colours.

#include <Eigen/Core>

namespace lobe {

using Vec2 = Eigen::Vector2f;
using Vec3 = Eigen::Vector3f;
/// Linear RGB with Rec. 709 primaries. An Eigen array, so that products are componentwise.
using Rgb = Eigen::Array3f;

inline float luminance(const Rgb& c) {
  return 0.212671f * c.x() + 0.715160f * c.y() + 0.072169f * c.z();
}
inline Rgb grey(float value) {
  return Rgb::Constant(value);
}

}  // namespace lobe
