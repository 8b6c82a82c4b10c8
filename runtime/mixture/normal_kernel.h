#pragma once
// The one place where the bivariate normal density is written for the inner loops, so that a sampler's pair weights and
// its density come from the same numbers.

#include <cmath>
#include <numbers>

#include "runtime/mixture/fast_exp.h"
#include "runtime/mixture/gaussian.h"

namespace lobe {

/// N((dx, dy) | 0, cov). By the Cholesky factor: stable for long thin lobes, where the terms of the adjugate's
/// quadratic form cancel. Loops over it vectorise.
inline float centredNormal(float dx, float dy, const Covariance& cov) {
  const float det = cov.determinant();
  const float inverse = 1.0f / cov.xx;
  const float across = dy - cov.xy * inverse * dx;
  const float square = dx * dx * inverse + across * across * (cov.xx / det);
  return 0.5f * std::numbers::inv_pi_v<float> / std::sqrt(det) * expNegative(-0.5f * square);
}

}  // namespace lobe
