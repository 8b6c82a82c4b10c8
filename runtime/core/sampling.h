#pragma once
// Maps from uniform random numbers to points and directions, with their densities over solid angle.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/core/vec.h"

namespace lobe {

inline constexpr float kPi = std::numbers::pi_v<float>;
inline constexpr float kInvPi = std::numbers::inv_pi_v<float>;
/// The largest float below one, the upper bound of uniform random numbers in [0, 1).
inline constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;

/// Maps a random number that is uniform in [bound, 1) to [0, 1), so that it can be used for another choice. bound < 1.
inline float rescaledAbove(float bound, float choice) {
  // The quotient may be rounded to 1.
  return std::min((choice - bound) / (1.0f - bound), kOneMinusEpsilon);
}

/// Maps u uniform in [0,1)² to a uniformly distributed point of the unit disc.
inline Vec2 squareToDisk(const Vec2& u) {
  const float r = std::sqrt(u.x());
  const float phi = 2.0f * kPi * u.y();
  return {r * std::cos(phi), r * std::sin(phi)};
}

/// Maps u uniform in [0,1)² to a direction with density cosθ/π over the upper hemisphere.
inline Vec3 squareToCosineHemisphere(const Vec2& u) {
  const Vec2 d = squareToDisk(u);
  return {d.x(), d.y(), std::sqrt(std::max(0.0f, 1.0f - d.squaredNorm()))};
}
inline float cosineHemispherePdf(const Vec3& w) {
  return std::max(0.0f, w.z()) * kInvPi;
}

/// Maps u uniform in [0,1)² to a uniformly distributed direction of the sphere (density 1/(4π)).
inline Vec3 squareToSphere(const Vec2& u) {
  const float z = 1.0f - 2.0f * u.x();
  const float r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  const float phi = 2.0f * kPi * u.y();
  return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace lobe
