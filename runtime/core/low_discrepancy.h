#pragma once
// Low-discrepancy sequences in the unit square and cube: additive recurrences with the roots of x^(d+1) = x + 1
// (Roberts 2018). Every range of consecutive indices has low discrepancy, so that disjoint ranges can serve as separate
// point sets.

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

namespace lobe {

/// Coordinate number `index` of the recurrence with the given step, in [0, 1).
inline float recurrencePoint(double step, long index) {
  const double x = 0.5 + step * static_cast<double>(index);
  return std::min(static_cast<float>(x - std::floor(x)), 0x1.fffffep-1f);
}

inline Eigen::Vector2f squarePoint(long index) {
  return {recurrencePoint(0.7548776662466927, index), recurrencePoint(0.5698402909980532, index)};
}

inline Eigen::Vector3f cubePoint(long index) {
  return {recurrencePoint(0.8191725133961645, index), recurrencePoint(0.6710436067037893, index),
          recurrencePoint(0.5497004779019703, index)};
}

}  // namespace lobe
