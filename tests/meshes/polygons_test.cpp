// Polygons and smoothing of meshes, and what the readers of all formats report in the same way.

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <numeric>
#include <random>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "scenes/meshes/obj.h"
#include "scenes/meshes/ply.h"
#include "scenes/meshes/polygon.h"
#include "scenes/meshes/serialized.h"
#include "tests/support/meshes_test_tools.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;
using Catch::Matchers::Contains;

namespace {

using Polygon = std::vector<Vec2>;

Polygon startingAt(Polygon corners, std::size_t first) {
  std::rotate(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(first), corners.end());
  return corners;
}

std::string plyOf(const Polygon& corners) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list int int vertex_indices\nend_header\n",
      corners.size());
  for (const Vec2& p : corners) text += fmt::format("{} {} 0\n", p.x(), p.y());
  text += fmt::format("{}", corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) text += fmt::format(" {}", i);
  return text + "\n";
}

std::string objOf(const Polygon& corners) {
  std::string text, face = "f";
  for (std::size_t i = 0; i < corners.size(); ++i) {
    text += fmt::format("v {} {} 0\n", corners[i].x(), corners[i].y());
    face += fmt::format(" {}", i + 1);
  }
  return text + face + "\n";
}

/// Two squares that share the edge from (0,0,0) to (0,1,0): one in z = 0 towards +x, the other rotated up about the
/// edge by this many degrees. They are faces 1 2 3 4 and 5 1 4 6.
std::string hinge(float degrees) {
  const float angle = degrees * std::numbers::pi_v<float> / 180;
  const float x = -std::cos(angle), z = std::sin(angle);
  return fmt::format("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv {0} 0 {1}\nv {0} 1 {1}\n", x, z);
}

/// The largest angle in degrees between a triangle's normal and those of its vertices.
double largestTurn(const TriangleMesh& mesh) {
  double largest = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3 normal =
        (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).normalized();
    for (const std::uint32_t i : t)
      largest = std::max(largest, std::atan2(normal.cross(mesh.normals[i]).norm(), normal.dot(mesh.normals[i])) *
                                      180.0 / std::numbers::pi);
  }
  return largest;
}

MeshOptions smoothUpTo(float degrees) {
  MeshOptions options;
  options.maxSmoothAngle = degrees;
  return options;
}

using Corners = std::vector<Eigen::Vector3d>;
using Triangle = std::array<std::size_t, 3>;

Eigen::Vector3d areaVector(const Corners& corners, const Triangle& triangle) {
  const auto [i, j, k] = triangle;
  return (corners[j] - corners[i]).cross(corners[k] - corners[i]);
}

double areaOf(const Corners& corners, const std::vector<Triangle>& triangles) {
  double area = 0;
  for (const Triangle& triangle : triangles) area += 0.5 * areaVector(corners, triangle).norm();
  return area;
}

/// The area of a polygon in a plane of constant z, by the shoelace formula.
double areaOf(const Corners& corners) {
  double area = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector3d &a = corners[i], &b = corners[(i + 1) % corners.size()];
    area += 0.5 * (a.x() * b.y() - b.x() * a.y());
  }
  return area;
}

/// Whether the corner at this index of the ring is an ear: no corner at another position lies in its triangle.
bool isEar(const Corners& corners, const std::vector<std::size_t>& ring, std::size_t at,
           const Eigen::Vector3d& normal) {
  const auto corner = [&](std::size_t i) { return ring[i % ring.size()]; };
  const Triangle triangle{corner(at + ring.size() - 1), ring[at], corner(at + 1)};
  const auto [a, b, c] = triangle;
  const double area = areaVector(corners, triangle).dot(normal);
  const auto isInside = [&, i = a, j = b, k = c](std::size_t p) {
    if (corners[p] == corners[i] || corners[p] == corners[j] || corners[p] == corners[k]) return false;
    return areaVector(corners, {i, j, p}).dot(normal) >= 0 && areaVector(corners, {j, k, p}).dot(normal) >= 0 &&
           areaVector(corners, {k, i, p}).dot(normal) >= 0;
  };
  return area == 0 || (area > 0 && std::ranges::none_of(ring, isInside));
}

/// Ear clipping without a search structure. Only the neighbours of a clipped ear are tested again.
std::vector<Triangle> clippedEars(const Corners& corners) {
  std::vector<std::size_t> ring(corners.size());
  std::iota(ring.begin(), ring.end(), std::size_t{0});
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (std::size_t i = 2; i < ring.size(); ++i) normal += areaVector(corners, {0, i - 1, i});
  std::vector<bool> ears(ring.size());
  for (std::size_t i = 1; i < ring.size(); ++i) ears[i] = isEar(corners, ring, i, normal);
  std::vector<Triangle> triangles;
  while (ring.size() > 3) {
    const auto first = std::find_if(ring.begin() + 1, ring.end(), [&](std::size_t corner) { return ears[corner]; });
    const std::size_t at = first == ring.end() ? 1 : static_cast<std::size_t>(first - ring.begin());
    triangles.push_back({ring[at - 1], ring[at], ring[(at + 1) % ring.size()]});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(at));
    if (at > 1) ears[ring[at - 1]] = isEar(corners, ring, at - 1, normal);
    if (at < ring.size()) ears[ring[at]] = isEar(corners, ring, at, normal);
  }
  triangles.push_back({ring[0], ring[1], ring[2]});
  return triangles;
}

}  // namespace

TEST_CASE("scenes: concave polygons in PLY and OBJ keep their area for every first corner") {
  const Folder folder;
  const std::vector<std::pair<Polygon, double>> shapes = {
      {{{-0.8f, -0.8f}, {0, 0}, {0.8f, -0.8f}, {0, 0.2f}}, 0.16},            // dart
      {{{0, 0}, {2, 0}, {2, 0.5f}, {0.5f, 0.5f}, {0.5f, 2}, {0, 2}}, 1.75},  // L
      {{{0, 0}, {5, 0}, {5, 3}, {4, 3}, {4, 1}, {3, 1}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}},
       11.0}};  // comb
  for (const auto& [corners, area] : shapes)
    for (std::size_t first = 0; first < corners.size(); ++first) {
      CAPTURE(area, first);
      const Polygon polygon = startingAt(corners, first);
      const TriangleMesh ply = readPly(folder.write("a.ply", plyOf(polygon)), {});
      const TriangleMesh obj = readObj(folder.write("a.obj", objOf(polygon)), {});
      CHECK(areaOf(ply) == Approx(area));
      CHECK(areaOf(obj) == Approx(area));
      CHECK(ply.triangles == obj.triangles);
      CHECK(ply.triangles.size() == corners.size() - 2);
    }
}

// Testing each corner against all others would take far longer than the time limit of a test.
TEST_CASE("scenes: polygons with a million corners are triangulated in nearly linear time") {
  constexpr std::size_t kCorners = kSanitized ? 100000 : 1000000;
  Corners comb;  // teeth along a straight side: half of the corners are reflex
  for (std::size_t i = 0; i < kCorners; ++i) comb.emplace_back(i, i % 2, 0);
  comb.emplace_back(kCorners, 2, 0);
  comb.emplace_back(0, 2, 0);
  CHECK(areaOf(comb, triangulate(comb)) == Approx(areaOf(comb)));

  Corners circle;
  for (std::size_t i = 0; i < kCorners; ++i) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(i) / kCorners;
    circle.emplace_back(std::cos(angle), std::sin(angle), 0);
  }
  const std::vector<Triangle> fan = triangulate(circle);
  REQUIRE(fan.size() == kCorners - 2);
  std::size_t different = 0;
  for (std::size_t i = 0; i < fan.size(); ++i) different += fan[i] != Triangle{0, i + 1, i + 2};
  CHECK(different == 0);
}

TEST_CASE("scenes: a polygon that would take quadratic time is rejected with the limit") {
  // Long thin triangles with the first corner pass half of the other corners closely.
  constexpr int kHalf = 20000;
  constexpr double kDistance = 1e-5;
  const Eigen::Vector3d along(1, 1, 0), across(-1, 1, 0);
  Corners corners{{0, 0, 0}};
  for (int i = 1; i <= kHalf; ++i) {
    const double u = static_cast<double>(i) / kHalf;
    corners.emplace_back((1 + 0.1 * u * (1 - u)) * along + 0.5 * kDistance * u * across);
  }
  for (int i = 1; i <= kHalf; ++i)
    corners.emplace_back((1 - static_cast<double>(i) / (kHalf + 1)) * along + kDistance * across);
  CHECK_THROWS_WITH(triangulate(corners),
                    "a polygon with 40001 corners takes more than 1000 steps per corner to triangulate");
}

TEST_CASE("scenes: polygons are triangulated as by testing each corner against all others") {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int repetition = 0; repetition < 300; ++repetition) {
    const std::size_t count = 4 + random() % 100;
    const bool simple = repetition % 2 == 0;
    Corners corners;
    for (std::size_t i = 0; i < count; ++i) {
      // A star, or a closed line on a coarse grid that intersects itself and visits some points several times.
      const double angle = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count);
      const double radius = 0.2 + uniform(random);
      if (simple)
        corners.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.3 * radius * std::cos(angle));
      else
        corners.emplace_back(random() % 8, random() % 8, 5);
    }
    CAPTURE(repetition);
    CHECK(triangulate(corners) == clippedEars(corners));
  }
}

TEST_CASE("scenes: normals are smooth only across edges below maxSmoothAngle") {
  const Folder folder;
  const std::filesystem::path path = folder.write("a.obj", hinge(40) + "f 1 2 3 4\nf 5 1 4 6\n");
  CHECK(largestTurn(readObj(path, {})) == Approx(20));
  const TriangleMesh creased = readObj(path, smoothUpTo(39));
  CHECK(creased.positions.size() == 8);
  CHECK(largestTurn(creased) == Approx(0).margin(1e-3));
  const TriangleMesh smooth = readObj(path, smoothUpTo(41));
  CHECK(smooth.positions.size() == 6);
  CHECK(largestTurn(smooth) == Approx(20));
}

TEST_CASE("scenes: maxSmoothAngle compares positions instead of indices and ignores the normals of the file") {
  const Folder folder;
  // The second square has its own vertices, and all vertices have a wrong normal.
  const std::string text = hinge(40) + "v 0 0 0\nv 0 1 0\nvn 1 0 0\nf 1//1 2//1 3//1 4//1\nf 5//1 7//1 8//1 6//1\n";
  const std::filesystem::path path = folder.write("a.obj", text);
  CHECK(largestTurn(readObj(path, smoothUpTo(39))) == Approx(0).margin(1e-3));
  const TriangleMesh smooth = readObj(path, smoothUpTo(41));
  CHECK(smooth.positions.size() == 6);
  CHECK(largestTurn(smooth) == Approx(20));
  // The angle is measured in world space.
  MeshOptions stretched = smoothUpTo(60);
  stretched.toWorld = Eigen::Affine3f(Eigen::Scaling(1.0f, 1.0f, 10.0f)).matrix();
  CHECK(largestTurn(readObj(path, stretched)) == Approx(0).margin(1e-3));
}

TEST_CASE("scenes: maxSmoothAngle takes a limited number of comparisons") {
  const Folder folder;
  const auto read = [&](int sides) {
    std::string cone = "v 0 0 1\n";
    for (int i = 0; i < sides; ++i) {
      const double angle = 2 * std::numbers::pi * i / sides;
      cone += fmt::format("v {} {} 0\nf 1 {} {}\n", std::cos(angle), std::sin(angle), i + 2, (i + 1) % sides + 2);
    }
    return readObj(folder.write("cone.obj", cone), smoothUpTo(0));
  };
  CHECK(read(9000).positions.size() == 3 * 9000);
  CHECK_THAT(faultOfReading([&] { read(60000); }),
             Contains("cone.obj: ") && Contains("more than 1000 comparisons for each of its 180000 corners"));
}

TEST_CASE("scenes: the normals of an OBJ are smooth within its groups as in Mitsuba") {
  const Folder folder;
  const std::filesystem::path path = folder.write("a.obj", hinge(40) + "g a\nf 1 2 3 4\ng b\nf 5 1 4 6\n");
  const auto turn = [&](ObjGrouping grouping) {
    const auto meshes = readObjByMaterial(path, {}, {{}, -1, grouping});
    REQUIRE(meshes.size() == 1);
    CHECK(areaOf(meshes[0]) == Approx(2));
    return largestTurn(meshes[0]);
  };
  CHECK(turn(ObjGrouping::joined) == Approx(20));
  CHECK(turn(ObjGrouping::separate) == Approx(0).margin(1e-3));
  CHECK(turn(ObjGrouping::collapsed) == Approx(20));
}

TEST_CASE("scenes: all mesh readers report in the same way why a file cannot be opened") {
  const Folder folder;
  for (const std::string type : {"obj", "ply", "serialized"}) {
    const auto fault = [&](const std::filesystem::path& path) {
      return faultOfReading([&] {
        if (type == "obj") readObj(path, {});
        if (type == "ply") readPly(path, {});
        if (type == "serialized") readSerialized(path, 0, {});
      });
    };
    const std::filesystem::path absent = folder.path() / "absent";
    CHECK(fault(absent) == absent.string() + ": no such file");
    CHECK(fault(folder.path()) == folder.path().string() + ": is a folder, not a file");
    CHECK_THAT(fault(folder.path() / std::string(300, 'a')), Contains("cannot open: ") && Contains("too long"));
  }
}

TEST_CASE("scenes: a vertex that is too far away is rejected") {
  const Folder folder;
  const auto fault = [&](const std::string& x) {
    return faultOfReading([&] { readObj(folder.write("a.obj", "v 0 0 0\nv " + x + " 0 0\nv 0 1 0\nf 1 2 3\n"), {}); });
  };
  CHECK(fault("9e14").empty());
  CHECK_THAT(fault("1e18"), Contains("a.obj: a vertex at 1e+18, 0, 0") && Contains("over 1e+15"));
}
