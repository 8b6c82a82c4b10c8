// Rectangles, cubes, disks, spheres and cylinders, and their transforms.

#include <array>
#include <limits>
#include <stdexcept>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "scenes/meshes/primitives.h"
#include "tests/support/meshes_test_tools.h"

using namespace lobe;
using namespace lobe::test;
using Catch::Matchers::Contains;

TEST_CASE("scenes: makeRectangle creates a transformed rectangle") {
  const TriangleMesh mesh = makeRectangle({});
  REQUIRE(areaOf(mesh) == Approx(4));
  for (std::size_t i = 0; i < 4; ++i) {
    REQUIRE(mesh.uvs[i] == Vec2((mesh.positions[i].head<2>() + Vec2(1, 1)) / 2));
    REQUIRE(mesh.normals[i] == Vec3::UnitZ());
  }
  requireNear(normalOf(mesh, 0), Vec3::UnitZ());
  requireNear(normalOf(mesh, 1), Vec3::UnitZ());
  requireNear(normalOf(makeRectangle(placed(mirror())), 0), Vec3::UnitZ());
  MeshOptions flipped;
  flipped.flipNormals = true;
  requireNear(normalOf(makeRectangle(flipped), 1), -Vec3::UnitZ());
}

TEST_CASE("scenes: makeCube creates a transformed cube") {
  for (const bool mirrored : {false, true}) {
    MeshOptions options = placed(mirrored ? mirror() : Eigen::Affine3f::Identity());
    options.faceNormals = mirrored;
    const TriangleMesh mesh = makeCube(options);
    REQUIRE(mesh.triangles.size() == 12);
    REQUIRE(areaOf(mesh) == Approx(24));
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const std::uint32_t corner = mesh.triangles[i][0];
      requireNear(normalOf(mesh, i), mesh.normals[corner]);
      REQUIRE(normalOf(mesh, i).dot(mesh.positions[corner]) == Approx(1));
    }
  }
}

TEST_CASE("scenes: a cube has the texture coordinates of Mitsuba's") {
  const TriangleMesh mesh = makeCube({});
  const auto uvAt = [&](const Vec3& normal, const Vec3& position) {
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      if (mesh.normals[i] == normal && mesh.positions[i] == position) return mesh.uvs[i];
    return Vec2(-1, -1);
  };
  // One corner of each face at (0, 1), and its neighbour at (1, 1).
  CHECK(uvAt({0, -1, 0}, {1, -1, -1}) == Vec2(0, 1));
  CHECK(uvAt({0, -1, 0}, {1, -1, 1}) == Vec2(1, 1));
  CHECK(uvAt({0, 1, 0}, {1, 1, -1}) == Vec2(0, 1));
  CHECK(uvAt({0, 1, 0}, {-1, 1, -1}) == Vec2(1, 1));
  CHECK(uvAt({1, 0, 0}, {1, -1, -1}) == Vec2(0, 1));
  CHECK(uvAt({1, 0, 0}, {1, 1, -1}) == Vec2(1, 1));
  CHECK(uvAt({0, 0, 1}, {1, -1, 1}) == Vec2(0, 1));
  CHECK(uvAt({0, 0, 1}, {1, 1, 1}) == Vec2(1, 1));
  CHECK(uvAt({-1, 0, 0}, {-1, -1, 1}) == Vec2(0, 1));
  CHECK(uvAt({-1, 0, 0}, {-1, 1, 1}) == Vec2(1, 1));
  CHECK(uvAt({0, 0, -1}, {1, 1, -1}) == Vec2(0, 1));
  CHECK(uvAt({0, 0, -1}, {1, -1, -1}) == Vec2(1, 1));
}

TEST_CASE("scenes: makeDisk creates a transformed disk") {
  const Eigen::Affine3f transform =
      Eigen::Translation3f(1, 2, 3) * Eigen::AngleAxisf(0.7f, Vec3(1, 2, 2) / 3) * Eigen::Scaling(2.0f, 2.0f, 5.0f);
  const Disk disk = makeDisk(placed(transform));
  requireNear(disk.centre, Vec3(1, 2, 3));
  REQUIRE(disk.u.norm() == Approx(2));
  requireNear(Vec3(disk.u.cross(disk.v) / 4), Vec3(transform.linear().col(2) / 5));
  REQUIRE_FALSE(disk.flipped);
  // Under mirroring, texture and front stay in place: (u, v) changes its handedness, and `flipped` compensates.
  const Disk mirrored = makeDisk(placed(mirror()));
  requireNear(mirrored.u.cross(mirrored.v), -Vec3::UnitZ());
  REQUIRE(mirrored.flipped);
  MeshOptions flipped;
  flipped.flipNormals = true;
  REQUIRE(makeDisk(flipped).flipped);
  const Disk ellipse = makeDisk(placed(Eigen::Affine3f(Eigen::Scaling(1.0f, 2.0f, 1.0f))));
  requireNear(ellipse.u, Vec3(1, 0, 0));
  requireNear(ellipse.v, Vec3(0, 2, 0));
}

TEST_CASE("scenes: makeSphere creates a transformed sphere") {
  const Eigen::Affine3f transform =
      Eigen::Translation3f(1, 2, 3) * Eigen::AngleAxisf(1.2f, Vec3::UnitY()) * Eigen::Scaling(-3.0f);
  const Sphere sphere = makeSphere({0, 1, 0}, 0.5f, placed(transform));
  requireNear(sphere.centre, Vec3(1, -1, 3));
  REQUIRE(sphere.radius == Approx(1.5f));
  requireNear(sphere.axes.col(1), Vec3(0, -1, 0));
  const Sphere old = makeSphere({0, 1, 0}, 0.5f, placed(transform), SphereTransform::old);
  requireNear(old.centre, Vec3(1, 1, 3));
  REQUIRE(old.radius == Approx(1.5f));
  REQUIRE((sphere.axes.transpose() * sphere.axes).isIdentity(1e-5f));
  MeshOptions flipped;
  flipped.flipNormals = true;
  REQUIRE(makeSphere(Vec3::Zero(), 1, flipped).flipped);
  // A mirroring transform turns the front inwards, but not in old files.
  REQUIRE(sphere.flipped);
  REQUIRE_FALSE(old.flipped);
  REQUIRE_FALSE(makeSphere(Vec3::Zero(), 1, {}).flipped);
  MeshOptions both = placed(mirror());
  both.flipNormals = true;
  REQUIRE_FALSE(makeSphere(Vec3::Zero(), 1, both).flipped);
  REQUIRE(makeSphere(Vec3::Zero(), 1, both, SphereTransform::old).flipped);
  REQUIRE_THROWS_AS(makeSphere(Vec3::Zero(), 0, {}), std::runtime_error);
  REQUIRE_THROWS_AS(makeSphere(Vec3::Zero(), 1, placed(Eigen::Affine3f(Eigen::Scaling(1.0f, 1.0f, 1.01f)))),
                    std::runtime_error);
}

TEST_CASE("scenes: makeCylinder creates a transformed cylinder") {
  const Eigen::Affine3f transform =
      Eigen::Translation3f(1, 2, 3) * Eigen::AngleAxisf(1.5707964f, Vec3::UnitX()) * Eigen::Scaling(2.0f, 2.0f, 5.0f);
  const Cylinder cylinder = makeCylinder({0, 0, 1}, {0, 0, 2}, 0.5f, placed(transform));
  requireNear(cylinder.base, Vec3(1, -3, 3));
  requireNear(cylinder.axis, Vec3(0, -5, 0));
  REQUIRE(cylinder.u.norm() == Approx(1));
  REQUIRE(cylinder.v.norm() == Approx(1));
  REQUIRE(cylinder.u.dot(cylinder.v) == Approx(0).margin(1e-6));
  REQUIRE_FALSE(makeCylinder({0, 0, 0}, {0, 0, 1}, 1, placed(mirror())).flipped);
  const auto scaled = [](float x, float y, float z) { return placed(Eigen::Affine3f(Eigen::Scaling(x, y, z))); };
  REQUIRE_THROWS_WITH(makeCylinder({0, 0, 0}, {0, 0, 1}, 1, scaled(1, 2, 1)), Contains("circular"));
  REQUIRE_THROWS_WITH(makeCylinder({0, 0, 0}, {1, 0, 1}, 1, scaled(1, 1, 2)), Contains("circular"));
  REQUIRE_THROWS_WITH(makeCylinder({0, 0, 1}, {0, 0, 1}, 1, {}), Contains("two different"));
}

TEST_CASE("scenes: singular and projective and non-finite transforms are rejected") {
  std::array<Eigen::Matrix4f, 3> bad;
  bad.fill(Eigen::Matrix4f::Identity());
  bad[0](2, 2) = 0;
  bad[1](3, 0) = 1;
  bad[2](0, 3) = std::numeric_limits<float>::quiet_NaN();
  for (const Eigen::Matrix4f& matrix : bad) {
    MeshOptions options;
    options.toWorld = matrix;
    REQUIRE_THROWS_WITH(makeCube(options), Contains("transform"));
    REQUIRE_THROWS_WITH(makeDisk(options), Contains("transform"));
    REQUIRE_THROWS_WITH(makeSphere(Vec3::Zero(), 1, options), Contains("transform"));
    REQUIRE_THROWS_WITH(makeCylinder(Vec3::Zero(), Vec3::UnitX(), 1, options), Contains("transform"));
  }
}
