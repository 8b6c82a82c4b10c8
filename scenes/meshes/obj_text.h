#pragma once
// Internal to scenes/: the parsed text of an OBJ file, before it is converted to meshes.

#include <string>
#include <string_view>
#include <vector>

#include "runtime/core/vec.h"

namespace lobe {

struct ObjData {
  static constexpr int kNone = -1;
  /// Indices from zero into the lists below; kNone for an attribute that the corner does not have.
  struct Corner {
    int position, uv, normal;
    bool operator==(const Corner&) const = default;
  };
  /// The material is an index into ObjData::materials. A mesh ends where a `g` or `usemtl` follows faces; the meshes of
  /// the file are numbered from zero.
  struct Face {
    std::size_t begin, end;  ///< range in ObjData::corners
    int material, mesh;
  };
  std::vector<Vec3> positions;
  std::vector<Vec2> uvs;  ///< v downwards
  std::vector<Vec3> normals;
  std::vector<Corner> corners;  ///< of all faces, concatenated
  std::vector<Face> faces;
  /// The distinct names given by `usemtl`; the first is the empty name of faces before any `usemtl`.
  std::vector<std::string> materials{""};
  int lastMaterial = 0;  ///< given by the last `usemtl`, even if no faces follow
};

/// Reads v, vt, vn, f, g and usemtl; other lines are ignored. A normal that is not finite is treated as missing, and a
/// texture coordinate that is not finite as zero. All indices in the result are in range and all faces have at least
/// three corners. Throws std::runtime_error with line number and text if the file violates this, and for malformed
/// numbers.
ObjData parseObj(std::string_view text);

/// The material names of an OBJ file, found without parsing its geometry.
struct ObjMaterials {
  std::string library;             ///< given by the last `mtllib`; empty if there is none
  std::vector<std::string> names;  ///< distinct names of materials that faces use, in the order of the file
  std::string last;                ///< name given by the last `usemtl`
};

/// onlyMesh: considers only the faces of this mesh (see ObjData::Face); negative for all meshes.
ObjMaterials findObjMaterials(std::string_view text, int onlyMesh);

}  // namespace lobe
