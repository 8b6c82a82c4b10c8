#pragma once
// The roughnesses at which lobes of textured roughness are fitted. They are the same for all textures, so that all
// materials of a model share their caches.

#include <algorithm>
#include <cmath>

namespace lobe {

/// Half an octave apart: between two levels, drawing from the linear mixture of theirs in place of the distribution of
/// normals has a relative variance of at most 0.001 (GGX) and 0.01 (Beckmann), far below what a fit costs; a whole
/// octave would make it 0.07. The lowest, 1/128, is narrower than what fits well.
inline constexpr int kRoughnessLevels = 15;

/// The alpha of a level in [0, kRoughnessLevels): 1/128 to 1, the same bits on every machine.
inline double roughnessOfLevel(int level) {
  const int below = kRoughnessLevels - 1 - level;
  return std::ldexp(below % 2 ? 0.70710678118654752440 : 1.0, -(below / 2));
}

/// Where an alpha > 0 lies among the levels, linear in its logarithm; clamped to [0, kRoughnessLevels − 1].
inline double levelOfRoughness(double alpha) {
  constexpr double kTop = kRoughnessLevels - 1;
  return std::clamp(kTop + 2.0 * std::log2(alpha), 0.0, kTop);
}

}  // namespace lobe
