// PLY files in text and in binary, and what is reported about malformed files.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "scenes/meshes/ply.h"
#include "tests/support/meshes_test_tools.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;
using Catch::Matchers::Contains;

namespace {

template <class T>
void put(std::string& bytes, T value, bool big) {
  std::array<char, sizeof(T)> raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if (big != (std::endian::native == std::endian::big)) std::ranges::reverse(raw);
  bytes.append(raw.data(), raw.size());
}

const std::string kPlyElements =
    "comment a square and a triangle\nelement vertex 5\nproperty float x\nproperty double y\nproperty float z\n"
    "property uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n"
    "element face 2\nproperty list uchar short weights\nproperty list uchar int vertex_indices\n"
    "element edge 1\nproperty list uint float ends\nend_header\n";

const std::vector<std::array<double, 2>> kCorners = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0.5, 2}};

std::string asciiPly() {
  std::string text = "ply\nformat ascii 1.0\n" + kPlyElements;
  for (const auto& [x, y] : kCorners) text += fmt::format("{} {} 0 200 0 0 1 {} 0.25\n", x, y, x);
  return text + "1 7 4 0 1 2 3\n0\n3 3 2 4\n2 0 +1e0\n";
}

std::string binaryPly(bool big) {
  std::string bytes = fmt::format("ply\nformat binary_{}_endian 1.0\n", big ? "big" : "little") + kPlyElements;
  for (const auto& [x, y] : kCorners) {
    put(bytes, static_cast<float>(x), big);
    put(bytes, y, big);
    put(bytes, 0.0f, big);
    put(bytes, std::uint8_t{200}, big);
    for (const float f : {0.0f, 0.0f, 1.0f, static_cast<float>(x), 0.25f}) put(bytes, f, big);
  }
  const auto face = [&](int weights, std::initializer_list<std::int32_t> indices) {
    put(bytes, static_cast<std::uint8_t>(weights), big);
    for (int i = 0; i < weights; ++i) put(bytes, std::int16_t{7}, big);
    put(bytes, static_cast<std::uint8_t>(indices.size()), big);
    for (const std::int32_t i : indices) put(bytes, i, big);
  };
  face(1, {0, 1, 2, 3});
  face(0, {3, 2, 4});
  put(bytes, std::uint32_t{1}, big);
  put(bytes, 1.0f, big);
  return bytes;
}

}  // namespace

TEST_CASE("scenes: PLY files in text and in either byte order are read") {
  const Folder folder;
  for (const std::string& bytes : {asciiPly(), binaryPly(false), binaryPly(true)}) {
    const TriangleMesh mesh = readPly(folder.write("a.ply", bytes), {});
    REQUIRE(mesh.triangles == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}, {3, 2, 4}});
    REQUIRE(mesh.positions.size() == 5);
    REQUIRE(mesh.positions[4] == Vec3(0.5f, 2, 0));
    REQUIRE(mesh.normals[1] == Vec3::UnitZ());
    REQUIRE(mesh.uvs[4] == Vec2(0.5f, 0.25f));
  }
  MeshOptions turned;
  turned.flipTexCoords = true;
  REQUIRE(readPly(folder.write("a.ply", asciiPly()), turned).uvs[4] == Vec2(0.5f, 0.75f));
}

TEST_CASE("scenes: PLY files without normals or with other property names or line endings are read") {
  const Folder folder;
  const TriangleMesh mesh = readPly(
      folder.write(
          "a.ply",
          "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float "
          "z\r\nproperty float texture_u\r\nproperty float texture_v\r\nelement face 1\r\nproperty list int uint "
          "vertex_index\r\nend_header\r\n0 0 0 0 0\r\n2 0 0 1 0\r\n0 2 0 0 1\r\n3 0 1 2\r\n"),
      {});
  REQUIRE(mesh.triangles.size() == 1);
  requireNear(mesh.normals[0], Vec3::UnitZ());
  REQUIRE(mesh.uvs[2] == Vec2(0, 1));
}

TEST_CASE("scenes: PLY faces may precede vertices") {
  const Folder folder;
  const TriangleMesh mesh = readPly(
      folder.write("a.ply",
                   "ply\nformat ascii 1.0\nelement face 1\nproperty list int int vertex_indices\nelement vertex 4\n"
                   "property float x\nproperty float y\nproperty float z\nend_header\n4 0 1 2 3\n"
                   "-0.8 -0.8 0\n0 0 0\n0.8 -0.8 0\n0 0.2 0\n"),
      {});
  CHECK(areaOf(mesh) == Approx(0.16));
}

TEST_CASE("scenes: PLY texture coordinates of faces are read") {
  const Folder folder;
  const auto ply = [&](const std::string& name, const std::string& faces) {
    return folder.write(
        "a.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "property float s\nproperty float t\nelement face 2\nproperty list uchar int vertex_indices\n"
        "property list uchar float " +
            name + "\nproperty int texnumber\nend_header\n0 0 0 9 9\n1 0 0 9 9\n1 1 0 9 9\n0 1 0 9 9\n" + faces);
  };
  for (const std::string name : {"texcoord", "texture_uv"}) {
    // The second triangle shows another part of the image, except at the corner at vertex 2.
    const TriangleMesh mesh =
        readPly(ply(name, "3 0 1 2 6 0 0 0.5 0 0.5 0.5 0\n3 0 2 3 6 0.25 0 0.5 0.5 0.25 0.75 0\n"), {});
    REQUIRE(mesh.triangles == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {3, 2, 4}});
    REQUIRE(mesh.uvs.size() == 5);
    CHECK(mesh.uvs[1] == Vec2(0.5f, 0));
    CHECK(mesh.uvs[3] == Vec2(0.25f, 0));
    CHECK(mesh.uvs[4] == Vec2(0.25f, 0.75f));
    CHECK(mesh.positions[3] == Vec3(0, 0, 0));
  }
  CHECK(readPly(ply("texcoord", "3 0 1 2 0 0\n3 0 2 3 0 0\n"), {}).uvs[3] == Vec2(0, 0));
  const auto fault = [&](const std::string& faces) {
    return faultOfReading([&] { readPly(ply("texcoord", faces), {}); });
  };
  CHECK_THAT(fault("3 0 1 2 4 0 0 1 1 0\n3 0 2 3 0 0\n"), Contains("3 corners has 4 texture coordinate"));
  CHECK_THAT(fault("3 0 1 2 6 0 0 1 1 1 nan 0\n3 0 2 3 0 0\n"), Contains("not a finite number"));
}

TEST_CASE("scenes: malformed PLY files are rejected with their name") {
  const Folder folder;
  const auto fault = [&folder](const std::string& bytes) {
    std::string what = faultOfReading([&] { readPly(folder.write("bad.ply", bytes), {}); });
    REQUIRE_THAT(what, Contains("bad.ply: ") && !Contains("\n"));
    return what;
  };
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  REQUIRE_THAT(fault(""), Contains("not a PLY"));
  REQUIRE_THAT(fault("plywood\n"), Contains("not a PLY"));
  REQUIRE_THAT(fault("ply\nformat ascii 1.0\n"), Contains("no end_header line"));
  REQUIRE_THAT(fault("ply\nend_header\n"), Contains("format"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "ascii", "morse")), Contains("morse"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "double", "quad")), Contains("quad"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "vertex 5", "vertex -5")), Contains("-5"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "property float x", "property float w")), Contains("x, y and z"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "vertex_indices", "corners")), Contains("vertex_indices"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "3 3 2 4", "3 3 2 5")), Contains("vertex 5, but there are 5"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "3 3 2 4", "3 3 2 -1")), Contains("-1"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "3 3 2 4", "3 3 2 x")), Contains("\"x\""));
  REQUIRE_THAT(fault(replaced(asciiPly(), "0.5 2 0", "0.5 nan 0")), Contains("finite"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "face 2", "face 0")), Contains("no triangles"));
  const std::string huge = replaced(binaryPly(false), "vertex 5", "vertex 18446744073709551615");
  REQUIRE_THAT(fault(huge), Contains("truncated"));
  for (const std::string& bytes : {asciiPly(), binaryPly(false)})
    for (std::size_t size = 0; size + 12 < bytes.size(); size += 7) fault(bytes.substr(0, size));
  REQUIRE_THAT(faultOfReading([&] { readPly(folder / "none.ply", {}); }), Contains("none.ply: no such file"));
}

TEST_CASE("scenes: PLY files that declare an element twice are rejected") {
  const Folder folder;
  const auto fault = [&](const std::string& text) {
    return faultOfReading([&] { readPly(folder.write("a.ply", "ply\nformat ascii 1.0\n" + text), {}); });
  };
  const std::string position = "property float x\nproperty float y\nproperty float z\n";
  const std::string normal = "property float nx\nproperty float ny\nproperty float nz\n";
  const std::string indices = "property list int int vertex_indices\n",
                    texcoords = "property list int float texcoord\n";
  // Without the check, there would be fewer normals than positions, and fewer texture coordinates than corners.
  CHECK_THAT(fault("element vertex 3\n" + position + normal + "element vertex 3\n" + position + "element face 1\n" +
                   indices + "end_header\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n0 0 1\n1 0 1\n0 1 1\n3 3 4 5\n"),
             Contains("a.ply: the header declares the element \"vertex\" twice"));
  CHECK_THAT(fault("element vertex 3\n" + position + "element face 1\n" + indices + texcoords + "element face 1\n" +
                   indices + "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1\n3 0 1 2\n"),
             Contains("a.ply: the header declares the element \"face\" twice"));
}

TEST_CASE("scenes: flipped bits in a PLY file never crash") {
  const Folder folder;
  const std::string bytes = binaryPly(false);
  int refused = 0;
  for (std::size_t i = 0; i < bytes.size() * 8; i += 5) {
    std::string damaged = bytes;
    damaged[i / 8] = static_cast<char>(damaged[i / 8] ^ (1 << i % 8));
    if (!faultOfReading([&] { readPly(folder.write("bad.ply", damaged), {}); }).empty()) ++refused;
  }
  REQUIRE(refused > 10);
}
