#pragma once
// Texture coordinates, moved about.

#include "materials/vec.h"

namespace lobe {

struct UvMap {
  Eigen::Matrix2f linear = Eigen::Matrix2f::Identity();
  Vec2 offset = Vec2::Zero();  ///< added after

  Vec2 operator()(const Vec2& uv) const { return linear * uv + offset; }
};

}  // namespace lobe
