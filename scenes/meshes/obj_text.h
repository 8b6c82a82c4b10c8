#pragma once
// Internal to scenes/: what the lines of an OBJ file say, before meshes are made of them.

#include <string>
#include <string_view>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

struct ObjData {
  static constexpr int kNone = -1;
  /// Indices from zero into the lists below; kNone for what the corner does not have.
  struct Corner {
    int position, uv, normal;
  };
  /// The material is an index into ObjData::materials. A mesh ends where a `g` or `usemtl` follows faces; the file's
  /// meshes are counted from zero.
  struct Face {
    std::size_t begin, end;  ///< of its corners
    int material, mesh;
  };
  std::vector<Vec3> positions;
  std::vector<Vec2> uvs;  ///< v downwards
  std::vector<Vec3> normals;
  std::vector<Corner> corners;  ///< of all faces, one after the other
  std::vector<Face> faces;
  /// The names that `usemtl` gives, each once; the first is the empty name of faces before any.
  std::vector<std::string> materials{""};
  int lastMaterial = 0;  ///< that of the last `usemtl`, whether or not faces follow
};

/// Reads v, vt, vn, f, g and usemtl; other lines are passed over. A normal that is not finite is as if it were not
/// there, and such a texture coordinate is zero. All indices are in range and all faces have three corners or more.
/// Throws std::runtime_error with line and text otherwise, and for numbers that are none.
ObjData parseObj(std::string_view text);

/// What an OBJ file says of materials, found without reading its geometry.
struct ObjMaterials {
  std::string library;             ///< of the last `mtllib`; empty without one
  std::vector<std::string> names;  ///< of those that faces have, each once, in the order of the file
  std::string last;                ///< that of the last `usemtl`
};

/// onlyMesh: of the faces of this mesh (see ObjData::Face) only; negative for all.
ObjMaterials findObjMaterials(std::string_view text, int onlyMesh);

}  // namespace lobe
