#pragma once
// An affine map of texture coordinates.

#include "runtime/core/fingerprint.h"
#include "runtime/core/vec.h"

namespace lobe {

struct UvMap {
  Eigen::Matrix2f linear = Eigen::Matrix2f::Identity();
  Vec2 offset = Vec2::Zero();  ///< added after the linear map

  Vec2 operator()(const Vec2& uv) const { return linear * uv + offset; }
  /// Adds both members to the hash.
  void addTo(Fingerprint& hash) const {
    hash.coefficients(linear);
    hash.coefficients(offset);
  }
};

}  // namespace lobe
