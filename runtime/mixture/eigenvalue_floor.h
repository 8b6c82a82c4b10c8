#pragma once
// Covariances in single precision that are positive definite.

#include <algorithm>
#include <cmath>

#include "runtime/mixture/gaussian.h"

namespace lobe {

inline Covariance rounded(double xx, double xy, double yy) {
  return {static_cast<float>(xx), static_cast<float>(xy), static_cast<float>(yy)};
}

/// The covariance with both eigenvalues raised to at least `floor` and to at least 1e-6 times the larger one, so that
/// it stays positive definite when rounded to floats. Returns floor · I if an entry is not finite.
inline Covariance withEigenvalueFloor(double xx, double xy, double yy, double floor) {
  const double safe = std::max(floor, 1e-6 * (xx + yy));
  if (xx > safe && (xx - safe) * (yy - safe) > xy * xy) return rounded(xx, xy, yy);
  const double mid = 0.5 * (xx + yy), half = std::hypot(0.5 * (xx - yy), xy);
  if (!std::isfinite(mid) || !std::isfinite(half)) return rounded(floor, 0, floor);
  const double large = std::max(mid + half, floor), small = std::max({mid - half, floor, 1e-6 * large});
  // Recompose with the original eigenvectors.
  const double ratio = half > 0 ? 0.5 * (large - small) / half : 0.0;
  const double middle = 0.5 * (large + small), difference = 0.5 * (xx - yy) * ratio;
  return rounded(middle + difference, xy * ratio, middle - difference);
}

}  // namespace lobe
