#pragma once
// Comparisons and meshes for the tests of the readers of images and meshes.

#include <stdexcept>
#include <string>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "scenes/meshes/mesh_options.h"
#include "scenes/scene.h"

namespace lobe::test {

// Code with sanitizers is many times slower.
#if defined(LOBE_SANITIZED)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// The message of the exception that the call throws; empty if there is none.
template <class Call>
std::string faultOfReading(const Call& call) {
  try {
    call();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

inline void requireNear(const Rgb& actual, const Rgb& expected, float tolerance = 1e-5f) {
  CAPTURE(actual.transpose(), expected.transpose());
  REQUIRE((actual - expected).abs().maxCoeff() <= tolerance);
}

inline void requireNear(const Vec3& actual, const Vec3& expected, float tolerance = 1e-5f) {
  requireNear(Rgb(actual.array()), Rgb(expected.array()), tolerance);
}

/// The normal of a triangle by its winding.
inline Vec3 normalOf(const TriangleMesh& mesh, std::size_t triangle) {
  const auto& [i, j, k] = mesh.triangles[triangle];
  return (mesh.positions[j] - mesh.positions[i]).cross(mesh.positions[k] - mesh.positions[i]).normalized();
}

inline double areaOf(const TriangleMesh& mesh) {
  double area = 0;
  for (const auto& [i, j, k] : mesh.triangles)
    area += 0.5 * (mesh.positions[j] - mesh.positions[i]).cross(mesh.positions[k] - mesh.positions[i]).norm();
  return area;
}

inline MeshOptions placed(const Eigen::Affine3f& transform) {
  MeshOptions options;
  options.toWorld = transform.matrix();
  return options;
}

inline Eigen::Affine3f mirror() {
  return Eigen::Affine3f(Eigen::Scaling(-1.0f, 1.0f, 1.0f));
}

}  // namespace lobe::test
