#pragma once
// The vector types of the public headers.

namespace lobe {

struct Float2 {
  float x, y;
};

struct Float3 {
  float x, y, z;
};

}  // namespace lobe
