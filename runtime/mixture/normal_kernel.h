#pragma once
// The bivariate normal density for inner loops.

#include <cmath>
#include <numbers>

#include "runtime/mixture/fast_exp.h"
#include "runtime/mixture/gaussian.h"

namespace lobe {

/// N((dx, dy) | 0, cov), by the Cholesky factor. This is accurate for elongated Gaussians, for which the terms of the
/// quadratic form with the adjugate cancel. Loops over this function vectorise.
inline float centredNormal(float dx, float dy, const Covariance& cov) {
  const float det = cov.determinant();
  const float inverse = 1.0f / cov.xx;
  const float across = dy - cov.xy * inverse * dx;
  const float square = dx * dx * inverse + across * across * (cov.xx / det);
  return 0.5f * std::numbers::inv_pi_v<float> / std::sqrt(det) * expNegative(-0.5f * square);
}

}  // namespace lobe
