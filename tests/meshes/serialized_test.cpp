// Serialized meshes, written here in Mitsuba's format.

#include <cstring>
#include <random>

#include <sys/resource.h>

#include <fmt/format.h>
#include <zlib.h>
#include <catch2/catch.hpp>

#include "scenes/meshes/serialized.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using Catch::Contains;

namespace {

template <class T>
void put(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

struct Written {
  std::uint16_t version = 4;
  std::uint32_t flags = 0x1003;  ///< single precision, normals, texture coordinates
  std::uint64_t vertices = 3, triangles = 1;
  std::uint32_t lastIndex = 2;
  float shift = 0;  ///< added to x
  std::string name = "a name";
  std::string rest;  ///< bytes after the triangle
};

template <class Real>
std::string vertexData(const Written& mesh) {
  std::string data;
  for (const Real x : {0, 0, 0, 1, 0, 0, 0, 1, 0}) put<Real>(data, x + static_cast<Real>(mesh.shift));
  if (mesh.flags & 1)
    for (const Real x : {0, 0, 1, 0, 0, 1, 0, 0, 1}) put(data, x);
  if (mesh.flags & 2)
    for (const Real x : {0.0, 0.25, 1.0, 0.25, 0.0, 0.75}) put(data, static_cast<Real>(x));
  if (mesh.flags & 8) data.append(9 * sizeof(Real), '\x3f');
  return data;
}

std::string compressed(const std::string& data) {
  uLongf size = compressBound(data.size());
  std::string packed(size, '\0');
  REQUIRE(compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(data.data()),
                   data.size()) == Z_OK);
  return packed.substr(0, size);
}

std::string meshBytes(const Written& mesh) {
  std::string data;
  put(data, mesh.flags);
  if (mesh.version == 4) data += mesh.name + '\0';
  put(data, mesh.vertices);
  put(data, mesh.triangles);
  data += mesh.flags & 0x2000 ? vertexData<double>(mesh) : vertexData<float>(mesh);
  for (const std::uint32_t i : {0u, 1u, mesh.lastIndex}) put(data, i);
  data += mesh.rest;
  std::string bytes;
  put<std::uint16_t>(bytes, 0x041c);
  put(bytes, mesh.version);
  return bytes + compressed(data);
}

std::string fileOf(const std::vector<Written>& meshes) {
  std::string bytes;
  std::vector<std::uint64_t> offsets;
  for (const Written& mesh : meshes) {
    offsets.push_back(bytes.size());
    bytes += meshBytes(mesh);
  }
  for (const std::uint64_t offset : offsets)
    if (meshes[0].version == 4)
      put(bytes, offset);
    else
      put(bytes, static_cast<std::uint32_t>(offset));
  put(bytes, static_cast<std::uint32_t>(offsets.size()));
  return bytes;
}

/// The most memory that this process has had, in kB.
long peakMemory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

TriangleMesh read(const std::string& bytes, int index = 0, const MeshOptions& options = {}) {
  const test::Folder folder;
  return readSerialized(folder.write("a.serialized", bytes), index, options);
}

}  // namespace

TEST_CASE("scenes: serialized meshes of both versions and precisions are read") {
  Written mesh;
  mesh.version = GENERATE(std::uint16_t{3}, std::uint16_t{4});
  mesh.flags = GENERATE(0x1003u, 0x2003u, 0x200bu);
  const TriangleMesh result = read(fileOf({mesh}));
  REQUIRE(result.positions.size() == 3);
  CHECK(result.positions[1] == Vec3(1, 0, 0));
  CHECK(result.normals.at(0) == Vec3(0, 0, 1));
  CHECK(result.uvs.at(2) == Vec2(0, 0.75f));
  CHECK(result.triangles == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}});
}

TEST_CASE("scenes: serialized meshes are selected by index") {
  Written first, second;
  second.shift = 10;
  second.flags = 0x1000;
  const TriangleMesh mesh = read(fileOf({first, second, first}), 1);
  CHECK(mesh.positions[0].x() == 10);
  CHECK(mesh.uvs.empty());
  CHECK(mesh.normals.size() == 3);  // computed
  second.flags = 0x1011;
  CHECK(read(fileOf({second})).normals.empty());  // flat according to the file's flag
}

TEST_CASE("scenes: malformed serialized meshes are rejected") {
  const Written good;
  const std::string bytes = fileOf({good, good});
  CHECK_THROWS_WITH(read(bytes, 2), Contains("a.serialized: there is no mesh 2") && Contains("has 2"));
  CHECK_THROWS_WITH(read("PLY, if anything"), Contains("not a serialized mesh"));
  CHECK_THROWS_WITH(read(""), Contains("not a serialized mesh"));
  CHECK_THROWS_WITH(readSerialized("/none/b.serialized", 0, {}), Contains("b.serialized"));
  Written bad;
  bad.version = 5;
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("version 5"));
  bad = good;
  bad.lastIndex = 3;
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("vertex 3 of 3"));
  bad = good;
  bad.vertices = std::uint64_t{1} << 25;
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("damaged"));
  bad.vertices = std::uint64_t{1} << 26;
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("more than 67108864 triangles and vertices together"));
  bad.vertices = std::uint64_t{1} << 62;
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("2^32"));
  bad = good;
  bad.triangles = std::uint64_t{1} << 25;
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("damaged"));
  bad.triangles = 0x5555555555555556;  // three times this is 2, because the product overflows
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("more than 2^32 triangles"));
  bad.triangles = 2;
  CHECK_THROWS_WITH(read(fileOf({bad})), Contains("damaged or truncated"));
}

TEST_CASE("scenes: a serialized mesh may have a name of up to 65536 bytes") {
  Written mesh;
  mesh.name = std::string(65536, 'a');
  CHECK(read(fileOf({mesh})).positions.size() == 3);
  mesh.name += 'a';
  CHECK_THROWS_WITH(read(fileOf({mesh})), Contains("a.serialized: the mesh's name is longer than 65536 bytes"));
}

TEST_CASE("scenes: large serialized meshes are read completely") {
  Written mesh;
  mesh.flags = 0x1010;
  mesh.vertices = 1000000;
  mesh.triangles = 500000;
  // The first three vertices are those of all meshes here, and the fourth has the bits of what is otherwise a triangle.
  for (std::uint32_t i = 4; i < mesh.vertices; ++i)
    for (const std::uint32_t x : {i, i + 1, i + 2}) put(mesh.rest, static_cast<float>(x));
  for (std::uint32_t i = 0; i < mesh.triangles; ++i)
    for (const std::uint32_t index : {i, i + 1, i + 2}) put(mesh.rest, index);
  const TriangleMesh result = read(fileOf({mesh}));
  REQUIRE(result.positions.size() == mesh.vertices);
  REQUIRE(result.triangles.size() == mesh.triangles);
  std::uint32_t wrong = 0;
  for (std::uint32_t i = 4; i < mesh.vertices; ++i)
    wrong += result.positions[i] != Vec3(static_cast<float>(i), static_cast<float>(i + 1), static_cast<float>(i + 2));
  for (std::uint32_t i = 0; i < mesh.triangles; ++i)
    wrong += result.triangles[i] != std::array<std::uint32_t, 3>{i, i + 1, i + 2};
  CHECK(wrong == 0);
}

TEST_CASE("scenes: a serialized mesh that claims more than it has takes no memory for it") {
  Written claim;
  // A file of a thousandth of what it claims.
  std::minstd_rand random;
  for (int i = 0; i < 1 << 20; ++i) claim.rest += static_cast<char>(random() >> 8);
  claim.vertices = 50000000;
  const std::string bytes = fileOf({claim});
  const long before = peakMemory();
  CHECK_THROWS_WITH(read(bytes), Contains("damaged or truncated"));
  CHECK(peakMemory() - before < 100000);  // of 600000
}

TEST_CASE("scenes: a serialized mesh that is too large for its file is refused before it is decompressed") {
  Written bomb;
  bomb.flags = 0x1000;
  bomb.vertices = 500000;
  bomb.triangles = 0;
  bomb.rest.assign(12 * bomb.vertices, '\0');
  const std::string bytes = fileOf({bomb});
  const test::Folder folder;
  const std::filesystem::path path = folder.write("a.serialized", bytes);
  const std::uintmax_t limit = 20 * bytes.size();
  REQUIRE(limit < bomb.vertices);
  const std::string fault = fmt::format(
      "a.serialized: the mesh has more than {} triangles and vertices together, the limit for a file of {} bytes",
      limit, bytes.size());
  CHECK_THROWS_WITH(readSerialized(path, 0, {}, 0), Contains(fault));
  CHECK_THROWS_WITH(readSerialized(path, 0, {}), Contains("no triangles"));  // below the limit that does no harm

  const std::filesystem::path small = folder.write("small.serialized", fileOf({Written{}}));
  CHECK(readSerialized(small, 0, {}, 0).positions.size() == 3);
}

TEST_CASE("scenes: serialized meshes with any wrong or missing byte never crash") {
  const std::string bytes = fileOf({Written{}, Written{}});
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string broken = bytes;
    broken[i] = static_cast<char>(broken[i] ^ 0xff);
    for (const std::string& tried : {broken, bytes.substr(0, i)}) try {
        read(tried, 1);
      } catch (const std::runtime_error& error) {
        CHECK_THAT(error.what(), Contains("a.serialized"));
      }
  }
}
