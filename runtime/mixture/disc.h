#pragma once
// The equal-area map between the upper hemisphere and the unit disc (Lambert's azimuthal projection; Herholz et al.
// 2016, Eq. 7, corrected): y = ω_xy / sqrt(1 + ω_z).
//
// Since dω = 2 dA, a density over the disc is twice the density over solid angle: p_ω = p_y / 2.

#include <algorithm>
#include <cmath>

#include "runtime/core/vec.h"

namespace lobe {

/// Maps a unit direction with z ≥ 0 to a point of the closed unit disc.
inline Vec2 toDisc(const Vec3& w) {
  return w.head<2>() / std::sqrt(1.0f + std::max(0.0f, w.z()));
}

/// Maps a point of the closed unit disc to a unit direction with z ≥ 0.
inline Vec3 fromDisc(const Vec2& y) {
  const float r2 = y.squaredNorm();
  const float scale = std::sqrt(std::max(0.0f, 2.0f - r2));
  return {y.x() * scale, y.y() * scale, std::max(0.0f, 1.0f - r2)};
}

inline bool insideDisc(const Vec2& y) {
  return y.squaredNorm() < 1.0f;
}

/// cosθ of the direction fromDisc(y).
inline float discCosine(const Vec2& y) {
  return std::max(0.0f, 1.0f - y.squaredNorm());
}

}  // namespace lobe
