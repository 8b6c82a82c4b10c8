#pragma once
// Helpers for the tests of materials/.

#include <cmath>
#include <initializer_list>
#include <numbers>
#include <string>
#include <utility>

#include "materials/registry.h"
#include "runtime/core/random.h"

namespace lobe {

inline Vec3 directionAt(double degrees, double azimuthDegrees = 0.0) {
  const double t = degrees * std::numbers::pi / 180.0;
  const double p = azimuthDegrees * std::numbers::pi / 180.0;
  return Eigen::Vector3d(std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)).cast<float>();
}

inline Parameters parametersOf(std::initializer_list<std::pair<std::string, ParameterValue>> values,
                               std::initializer_list<BsdfPtr> children = {}) {
  Parameters parameters;
  for (const auto& [name, value] : values) parameters.set(name, value);
  for (const BsdfPtr& child : children) parameters.addChild(child);
  return parameters;
}

inline BsdfPtr bsdfOf(const std::string& type,
                      std::initializer_list<std::pair<std::string, ParameterValue>> values = {},
                      std::initializer_list<BsdfPtr> children = {}) {
  return makeBsdf(type, parametersOf(values, children));
}

/// Running mean and its standard error.
struct Mean {
  double sum = 0.0, squares = 0.0;
  long count = 0;
  void add(double x) { sum += x, squares += x * x, ++count; }
  double value() const { return sum / static_cast<double>(count); }
  double error() const {
    const double n = static_cast<double>(count);
    return std::sqrt(std::max(0.0, squares / n - value() * value()) / n);
  }
};

inline const Vec2 kUv(0.25f, 0.75f);

}  // namespace lobe
