#pragma once
// Internal to scenes/: what the lines of an OBJ file say, before meshes are made of them.

#include <string>
#include <string_view>
#include <vector>

#include "materials/vec.h"

namespace lobe {

struct ObjData {
  static constexpr int kNone = -1;
  /// Indices from zero into the lists below; kNone for what the corner does not have.
  struct Corner {
    int position, uv, normal;
  };
  std::vector<Vec3> positions;
  std::vector<Vec2> uvs;  ///< v downwards
  std::vector<Vec3> normals;
  std::vector<Corner> corners;           ///< of all faces, one after the other
  std::vector<std::size_t> faceEnds{0};  ///< face i has the corners from faceEnds[i] to before faceEnds[i + 1]
  std::vector<int> faceParts;  ///< of each face: the index of its material among those asked for, or their count
};

/// Reads v, vt, vn, f and usemtl; other lines are passed over. Lines may end by LF, CR or both, and go on after a
/// backslash; a byte order mark before them does not matter. A normal that is not finite is as if it were not there,
/// and such a texture coordinate is zero. All indices are in range and all faces have three corners or more. Throws
/// std::runtime_error with line and text otherwise, and for numbers that are none.
ObjData parseObj(std::string_view text, const std::vector<std::string>& materials);

}  // namespace lobe
