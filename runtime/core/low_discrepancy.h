#pragma once
// Points that fill the unit square and cube evenly: additive recurrences on the roots of x^(d+1) = x + 1 (Roberts
// 2018). Any run of consecutive indices is even, so runs that follow each other serve as fresh points.

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

namespace lobe {

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
