#pragma once
// Options for placing the shapes of a scene file in the world.

#include <optional>

#include <Eigen/Core>

namespace lobe {

struct MeshOptions {
  Eigen::Matrix4f toWorld = Eigen::Matrix4f::Identity();  ///< affine and invertible
  bool faceNormals = false;                               ///< flat shading: vertex normals are dropped
  /// Degrees. Vertex normals are recomputed, smooth only across triangles whose normals differ by less than this angle
  /// (Mitsuba's maxSmoothAngle). Cannot be combined with faceNormals.
  std::optional<float> maxSmoothAngle;
  bool flipNormals = false;  ///< exchanges front and back
  /// Flips v relative to the convention of the format: v of an OBJ counts upwards from the last row of the image, v of
  /// a PLY or primitive downwards from the first. It is set where Mitsuba's flip_tex_coords differs from its default
  /// (true for OBJ, false for PLY).
  bool flipTexCoords = false;
};

}  // namespace lobe
