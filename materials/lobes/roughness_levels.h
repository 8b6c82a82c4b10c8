#pragma once
// The roughness levels at which lobes of textured roughness are fitted. They are the same for all textures, so that all
// materials of a model share their caches.

#include <algorithm>
#include <cmath>

namespace lobe {

/// Number of levels, which are half an octave apart. Sampling a linear mixture of two adjacent levels instead of the
/// distribution of normals between them has a relative variance of at most 0.001 (GGX) and 0.01 (Beckmann), far below
/// that of a fit; with whole octaves it would be 0.07. The lobe of the lowest level, 1/128, is too narrow for a good
/// fit.
inline constexpr int kRoughnessLevels = 15;

/// The alpha of a level in [0, kRoughnessLevels): 1/128 to 1, bitwise equal on all machines.
inline double roughnessOfLevel(int level) {
  const int below = kRoughnessLevels - 1 - level;
  return std::ldexp(below % 2 ? 0.70710678118654752440 : 1.0, -(below / 2));
}

/// The fractional level of an alpha > 0, linear in its logarithm; clamped to [0, kRoughnessLevels − 1].
inline double levelOfRoughness(double alpha) {
  constexpr double kTop = kRoughnessLevels - 1;
  return std::clamp(kTop + 2.0 * std::log2(alpha), 0.0, kTop);
}

}  // namespace lobe
