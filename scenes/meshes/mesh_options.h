#pragma once
// How the shapes of a scene file are put into the world.

#include <optional>

#include <Eigen/Core>

namespace lobe {

struct MeshOptions {
  Eigen::Matrix4f toWorld = Eigen::Matrix4f::Identity();  ///< affine and invertible
  bool faceNormals = false;                               ///< flat triangles: vertex normals are dropped
  /// Degrees: vertex normals are dropped and made anew, smooth only among triangles of which the normals differ by less
  /// (Mitsuba's maxSmoothAngle). Not together with faceNormals.
  std::optional<float> maxSmoothAngle;
  bool flipNormals = false;  ///< exchanges front and back
  /// Turns v around from what the format makes of it: an OBJ's v counts upwards from the image's last row, a PLY's and
  /// a primitive's v downwards from the first. So Mitsuba's flip_tex_coords differs from its default (true for OBJ,
  /// false for PLY).
  bool flipTexCoords = false;
};

}  // namespace lobe
