#pragma once
// The vector types of the public headers: plain structs, so that hosts need no linear-algebra library.

namespace lobe {

struct Float2 {
  float x, y;
};

struct Float3 {
  float x, y, z;
};

}  // namespace lobe
