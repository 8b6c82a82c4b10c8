// OBJ files: their vertices, normals and materials, and what is reported about malformed files.

#include <array>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "scenes/meshes/mtl.h"
#include "scenes/meshes/obj.h"
#include "tests/support/meshes_test_tools.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;
using Catch::Matchers::Contains;

TEST_CASE("scenes: OBJ shares vertices and keeps normals and texture coordinates") {
  const Folder folder;
  const std::filesystem::path path =
      folder.write("quad.obj",
                   "# a square\r\nmtllib none.mtl\no quad\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\n"
                   "v 0 1e0 0 # corner\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0.25 0.75 0\nvn 0 0 2\n"
                   "usemtl none\ng first\ns 1\nf 1/1/1 2/2/1 3/3/1\ng second\nf -4/-4/-1 -2/-2/-1 -1/-1/-1");
  const TriangleMesh mesh = readObj(path, {});
  REQUIRE(mesh.positions.size() == 4);
  REQUIRE(mesh.triangles == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}});
  for (const Vec3& n : mesh.normals) requireNear(n, Vec3::UnitZ());
  REQUIRE(mesh.uvs[3] == Vec2(0.25f, 0.25f));  // v downwards
  REQUIRE(mesh.positions[2] == Vec3(1, 1, 0));

  MeshOptions asIs;
  asIs.flipTexCoords = true;
  REQUIRE(readObj(path, asIs).uvs[3] == Vec2(0.25f, 0.75f));
  MeshOptions flat;
  flat.faceNormals = true;
  REQUIRE(readObj(path, flat).normals.empty());
}

TEST_CASE("scenes: OBJ corners that differ in normal or uv become separate vertices") {
  const Folder folder;
  const std::string text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvn 0 1 1\nvt 0 0\nvt 1 1\n";
  const TriangleMesh normals = readObj(folder.write("a.obj", text + "f 1//1 2//1 3//1\nf 1//1 3//2 4//1\n"), {});
  REQUIRE(normals.positions.size() == 5);
  REQUIRE(normals.uvs.empty());
  const TriangleMesh uvs = readObj(folder.write("b.obj", text + "f 1/1 2/1 3/1\nf 1/2 3/1 4\n"), {});
  REQUIRE(uvs.positions.size() == 5);
  REQUIRE(uvs.uvs.back() == Vec2(0, 0));  // a corner without texture coordinates
}

TEST_CASE("scenes: convex and concave OBJ polygons are triangulated") {
  const Folder folder;
  const auto areaOfPolygon = [&folder](const std::vector<Vec2>& corners) {
    std::string text, face = "f";
    for (const Vec2& p : corners) text += fmt::format("v {} {} 3\n", p.x(), p.y());
    for (std::size_t i = 1; i <= corners.size(); ++i) face += fmt::format(" {}", i);
    const TriangleMesh mesh = readObj(folder.write("polygon.obj", text + face + "\n"), {});
    REQUIRE(mesh.triangles.size() == corners.size() - 2);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) requireNear(normalOf(mesh, i), Vec3::UnitZ());
    return areaOf(mesh);
  };
  REQUIRE(areaOfPolygon({{0, 0}, {4, 0}, {1, 1}, {0, 4}}) == Approx(4));
  REQUIRE(areaOfPolygon({{1, 1}, {0, 4}, {0, 0}, {4, 0}}) == Approx(4));
  REQUIRE(areaOfPolygon({{0, 4}, {0, 0}, {4, 0}, {1, 1}}) == Approx(4));
  // A comb with two teeth.
  REQUIRE(areaOfPolygon({{0, 0}, {5, 0}, {5, 3}, {4, 3}, {4, 1}, {3, 1}, {3, 3}, {0, 3}}) == Approx(13));
  std::vector<Vec2> round;
  for (int i = 0; i < 300; ++i)
    round.emplace_back(Eigen::Rotation2Df(i * 2 * std::numbers::pi_v<float> / 300) * Vec2(1, 0));
  REQUIRE(areaOfPolygon(round) == Approx(std::numbers::pi).epsilon(1e-3));
}

TEST_CASE("scenes: missing normals are averaged by angle unless flat ones are requested") {
  const Folder folder;
  // A corner of a cube: three squares, one of them as two triangles that must not count twice.
  const std::filesystem::path path = folder.write("corner.obj",
                                                  "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\n"
                                                  "f 1 2 3\nf 1 3 4\nf 5 6 2 1\nf 7 5 1 4\n");
  const TriangleMesh smooth = readObj(path, {});
  REQUIRE(smooth.normals.size() == smooth.positions.size());
  requireNear(smooth.normals[0], Vec3(1, 1, 1).normalized());
  REQUIRE(areaOf(smooth) == Approx(3));
  MeshOptions flat;
  flat.faceNormals = true;
  REQUIRE(readObj(path, flat).normals.empty());
  // One corner has no normal, so none of the file's normals are used.
  const TriangleMesh partial =
      readObj(folder.write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nf 1//1 2//1 3\n"), {});
  requireNear(partial.normals[0], Vec3::UnitZ());
}

TEST_CASE("scenes: transforms are applied to normals and keep the front") {
  const Folder folder;
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 1\n";
  const std::filesystem::path with = folder.write("with.obj", triangle + "vn 0 -1 1\nf 1//1 2//1 3//1\n");
  const std::filesystem::path without = folder.write("without.obj", triangle + "f 1 2 3\n");

  const Eigen::Affine3f stretched = Eigen::Translation3f(1, 2, 3) * Eigen::Scaling(1.0f, 1.0f, 3.0f);
  const TriangleMesh mesh = readObj(with, placed(stretched));
  requireNear(mesh.positions[2], Vec3(1, 3, 6));
  requireNear(mesh.normals[0], Vec3(0, -3, 1).normalized());
  requireNear(normalOf(mesh, 0), mesh.normals[0]);

  const TriangleMesh mirrored = readObj(with, placed(mirror()));
  requireNear(mirrored.normals[0], Vec3(0, -1, 1).normalized());
  requireNear(normalOf(mirrored, 0), mirrored.normals[0]);
  // Without normals, the winding in world space determines the front.
  const TriangleMesh wound = readObj(without, placed(mirror()));
  requireNear(normalOf(wound, 0), Vec3(0, 1, -1).normalized());
  requireNear(wound.normals[0], normalOf(wound, 0));

  for (const std::filesystem::path& path : {with, without}) {
    MeshOptions flipped;
    flipped.flipNormals = true;
    const TriangleMesh back = readObj(path, flipped);
    requireNear(back.normals[0], Vec3(0, 1, -1).normalized());
    requireNear(normalOf(back, 0), back.normals[0]);
  }
}

TEST_CASE("scenes: malformed OBJ files are rejected with their name") {
  const Folder folder;
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
  const auto fault = [&folder](const std::string& text) {
    const std::string what = faultOfReading([&] { readObj(folder.write("bad.obj", text), {}); });
    REQUIRE_THAT(what, Contains("bad.obj: ") && !Contains("\n"));
    return what;
  };
  REQUIRE_THAT(fault(vertices + "f 1 2 4\n"), Contains("vertex that does not exist (the file has 3)"));
  REQUIRE_THAT(fault(vertices + "f 1 2 -4\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 0 1 2\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 1 2 3 9\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 1 2 3 1 2 99999999999\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 1/1 2/2 3/1\n"), Contains("texture coordinate"));
  REQUIRE_THAT(fault(vertices + "f 1//1 2//1 3//-2\n"), Contains("normal"));
  REQUIRE_THAT(fault("v 0 0 0\nv nan 0 0\n"), Contains("line 2"));
  REQUIRE_THAT(fault("v 0 0 0\n\nv 1 0\n"), Contains("line 3"));
  REQUIRE_THAT(fault(vertices + "f a b c\n"), Contains("line 6") && Contains("\"a\""));
  REQUIRE_THAT(fault(vertices + "f 99999999999999999999 1 2\n"), Contains("line 6") && Contains("999 1 2"));
  REQUIRE_THAT(fault(vertices + "f 1/99999999999999999999 2/1 3/1\n"), Contains("texture coordinate"));
  REQUIRE_THAT(fault(vertices + "f 1 2 3/1/1/1\n"), Contains("\"3/1/1/1\""));
  REQUIRE_THAT(fault(vertices + "\n\nf 1 2\n"), Contains("line 8") && Contains("three corners"));
  REQUIRE_THAT(fault("v 0 0 1e99\nv 0 1 0\nv 1 0 0\nf 1 2 3\n"), Contains("not a finite number"));
  REQUIRE_THAT(fault(vertices), Contains("no triangles"));
  REQUIRE_THAT(fault(""), Contains("no triangles"));
  REQUIRE_THAT(fault(std::string("\0\x7f\xff\n\0v f\n", 10)), Contains("no triangles"));
  REQUIRE_THAT(faultOfReading([&] { readObj(folder / "none.obj", {}); }), Contains("none.obj: no such file"));
  REQUIRE_THAT(faultOfReading([&] { readObj(folder / ".", {}); }), Contains("not a file"));
}

TEST_CASE("scenes: OBJ files with various line endings and indices and orders are read") {
  const Folder folder;
  const auto read = [&folder](const std::string& text) { return readObj(folder.write("a.obj", text), {}); };
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nvn 1 0 0\n";
  const std::string face = "f 1/1/1 2/1/1 3/1/1\n";
  const auto withEnds = [](std::string text, const std::string& end) {
    for (std::size_t i = 0; (i = text.find('\n', i)) != std::string::npos; i += end.size()) text.replace(i, 1, end);
    return text;
  };
  for (const std::string& text :
       {vertices + face, "\xef\xbb\xbf" + vertices + face, withEnds(vertices + face, "\r"),
        withEnds(vertices + face, "\r\n"), face + vertices, vertices + "f 1/1/1 \\\n 2/1/1 \\\r\n3/1/1 # end",
        "v 0 0 0 1 \\\n0.5 0\n" + vertices + "f -3/-1/-1 -2/-1/-1 +4/1/1"}) {
    CAPTURE(text);
    const TriangleMesh mesh = read(text);
    REQUIRE(mesh.triangles.size() == 1);
    REQUIRE(mesh.positions[1] == Vec3(1, 0, 0));
    REQUIRE(mesh.uvs[2] == Vec2(0.5f, 0.75f));
    REQUIRE(mesh.normals[0] == Vec3(1, 0, 0));
  }
  REQUIRE(read(vertices + "f 1/1/ 2/1/ 3/1/\n").normals[0] == Vec3::UnitZ());
  const TriangleMesh broken = read(vertices + "vt nan 0\nvn nan -nan(ind) 0\nf 1/2/2 2/1/1 3/1/1\n");
  REQUIRE(broken.uvs[0] == Vec2(0, 0));
  REQUIRE(broken.normals[0] == Vec3::UnitZ());
}

// Searching all vertices at a position would take far longer than the time limit of a test.
TEST_CASE("scenes: an OBJ with many texture coordinates at a position is read in linear time") {
  constexpr int kFaces = kSanitized ? 100000 : 1000000;
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < 2 * kFaces; ++i) text += fmt::format("vt {} 0\n", i);
  for (int i = 0; i < kFaces; ++i) text += fmt::format("f 1/{} 2/{} 3/1\n", 2 * i + 1, 2 * i + 2);
  text += "f 1/1 2/2 3/1\n";
  const Folder folder;
  const TriangleMesh mesh = readObj(folder.write("a.obj", text), {});
  CHECK(mesh.positions.size() == 2 * kFaces + 1);
  // Vertices are in the order in which faces mention them first.
  CHECK(mesh.triangles[0] == std::array<std::uint32_t, 3>{0, 1, 2});
  CHECK(mesh.triangles[1] == std::array<std::uint32_t, 3>{3, 4, 2});
  CHECK(mesh.triangles.back() == mesh.triangles[0]);
  CHECK(mesh.uvs[4].x() == 3);
}

// Comparing the name of each material with those of all others would take far longer than the time limit of a test.
TEST_CASE("scenes: an OBJ is split into many materials in linear time") {
  constexpr int kMaterials = kSanitized ? 100000 : 1000000;
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 2 0\nf 1 2 3\n";
  ObjSelection selection;
  for (int i = 0; i < kMaterials; ++i) {
    selection.materials.push_back(fmt::format("material {}", i));
    text += fmt::format("usemtl material {}\nf 1 2 4\n", i);
  }
  selection.materials.push_back("material 0");  // the first one of a name has the faces
  const Folder folder;
  const std::vector<TriangleMesh> meshes = readObjByMaterial(folder.write("a.obj", text), {}, selection);
  REQUIRE(meshes.size() == kMaterials + 2);
  CHECK(areaOf(meshes.front()) == Approx(1));
  CHECK(areaOf(meshes[kMaterials - 1]) == Approx(1));
  CHECK(meshes[kMaterials].triangles.empty());
  CHECK(areaOf(meshes.back()) == Approx(0.5));
}

TEST_CASE("scenes: faults of a material library name their line") {
  const auto faults = [](const std::string& text) { return parseMtl(text).front().faults; };
  CHECK(faults("\r\nnewmtl a\r\nbump \\\n-s 2 b.png\rbump -o c.png\n") ==
        std::vector<std::string>{"line 3: the options of the image are ignored: \"bump \\\"",
                                 "line 5: the options of the image are ignored: \"bump -o c.png\""});
  CHECK_THROWS_WITH(parseMtl("newmtl a\n\nKd x\n"), "line 3: \"x\" is not a number: \"Kd x\"");
  // Counting the lines before each fault would take far longer than the time limit of a test.
  constexpr int kFaults = kSanitized ? 100000 : 500000;
  std::string text = "newmtl a\n";
  for (int i = 0; i < kFaults; ++i) text += "bump - b\n";
  CHECK(faults(text).size() == kFaults);
}

TEST_CASE("scenes: the meshes of an OBJ are numbered as in Mitsuba 0.6") {
  const Folder folder;
  // Neither a second `g` before any face nor `o` begins a mesh, but `usemtl` does.
  const std::filesystem::path path =
      folder.write("a.obj",
                   "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 2 0\nv 0 3 0\nv 0 4 0\ng a\nusemtl one\ng b\nf 1 2 3\no c\nf 1 "
                   "2 4\nusemtl two\nf 1 2 5\ng d\ng e\nf 1 2 6\n");
  const auto areas = [&](int mesh, ObjGrouping grouping) {
    std::vector<double> result;
    for (const TriangleMesh& part : readObjByMaterial(path, {}, {{"one", "two"}, mesh, grouping}))
      result.push_back(areaOf(part));
    return result;
  };
  using Areas = std::vector<double>;
  CHECK(areas(-1, ObjGrouping::separate) == Areas{1.5, 3.5, 0});
  CHECK(areas(0, ObjGrouping::separate) == Areas{1.5, 0, 0});
  CHECK(areas(1, ObjGrouping::joined) == Areas{0, 1.5, 0});
  CHECK(areas(2, ObjGrouping::separate) == Areas{0, 2, 0});
  CHECK(areas(-1, ObjGrouping::collapsed) == Areas{0, 5, 0});
  CHECK_THAT(faultOfReading([&] { areas(3, ObjGrouping::separate); }),
             Contains("a.obj: there is no mesh 3: the file has 3, counted from 0"));
}
