// The illumination file: round trips and rejection of invalid files.

#include <bit>
#include <functional>
#include <limits>

#include "illumination_generated.h"
#include "runtime/core/atomic_file.h"
#include "schema/illumination_file.h"
#include "tests/support/schema_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

struct Content {
  IlluminationInfo info;
  std::vector<StoredIllumination> records;
  std::vector<CacheComponent> components;
  std::vector<float> likelihoodGains;
  std::vector<std::byte> encode() const { return encodeIllumination(info, records, components, likelihoodGains); }
};

Content smallFile() {
  Content c;
  c.info = {"0.1.0", "house/scene.xml", 0x0123456789abcdef, {"photons", 3, 1000, 500, 8, 7, true, 6}, 2500, 0.25, 0.5f};
  c.records = {{{1, 2, 3}, {0, 0, 1}, {1, 0, 0}, 0.5f, 0.25f, 3.5f, 100, 0.3f, 0, 2},
               {{-1, 0, 5}, {0, 1, 0}, {0, 0, -1}, 0.125f, 1.0f, 0, 0, 0.9f, 2, 0}};
  c.components = {{0.25f, -0.1f, 0.3f, 0.02f, 0.0f, 0.05f}, {0.75f, 0.4f, -0.2f, 0.01f, -0.005f, 0.06f}};
  c.likelihoodGains = {1.5f, -0.25f};
  return c;
}

struct Opener {
  TemporaryFolder folder;
  std::filesystem::path path = folder.path / "a.illum";

  /// The error message of opening a file with these bytes; empty if it succeeds.
  std::string fault(const std::vector<std::byte>& bytes) const {
    writeAtomically(path, std::span<const std::byte>(bytes));
    try {
      IlluminationFile::open(path);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return {};
  }
};

}  // namespace

TEST_CASE("schema: an illumination file reads back as written") {
  const Opener opener;
  const Content c = smallFile();
  REQUIRE(c.encode() == c.encode());
  REQUIRE(opener.fault(c.encode()).empty());
  const IlluminationFile file = IlluminationFile::open(opener.path);
  const IlluminationInfo& info = file.info();
  CHECK((info.toolVersion == "0.1.0" && info.scene == "house/scene.xml" && info.sceneHash == 0x0123456789abcdef));
  CHECK(info.settings == c.info.settings);
  CHECK((info.particles == 2500 && info.undersampledFraction == 0.25 && info.unit == 0.5f));
  CHECK(std::ranges::equal(std::as_bytes(file.records()), std::as_bytes(std::span(c.records))));
  const auto mixture = file.components(file.records()[0]);
  CHECK(std::ranges::equal(std::as_bytes(mixture), std::as_bytes(std::span(c.components))));
  CHECK(file.components(file.records()[1]).empty());
  CHECK((file.likelihoodGain(file.records()[0]) == 1.5f && file.likelihoodGain(file.records()[1]) == -0.25f));
  CHECK(file.bytes() == c.encode().size());
}

TEST_CASE("schema: the layout of illumination records matches the FlatBuffers schema") {
  const StoredIllumination r{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, 10, 11, 12, 13, 14, 15, 16};
  const auto f = std::bit_cast<fb::IlluminationRecord>(r);
  CHECK((f.position().x() == 1 && f.position().y() == 2 && f.position().z() == 3));
  CHECK((f.normal().x() == 4 && f.normal().z() == 6 && f.tangent().x() == 7 && f.tangent().z() == 9));
  CHECK((f.radius() == 10 && f.background() == 11 && f.irradiance() == 12 && f.samples() == 13 &&
         f.bsdf_fraction() == 14 && f.first() == 15 && f.count() == 16));
}

TEST_CASE("schema: an illumination file without records is valid") {
  Content c = smallFile();
  c.records.clear();
  c.components.clear();
  c.likelihoodGains.clear();
  CHECK(Opener().fault(c.encode()).empty());
}

TEST_CASE("schema: illumination files with a flipped bit or truncated are rejected") {
  const Opener opener;
  const std::vector<std::byte> good = smallFile().encode();
  std::string accepted;
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::vector<std::byte> bad = good;
    bad[i] ^= static_cast<std::byte>(1u << (i % 8));
    if (!contains(opener.fault(bad), "a.illum: ")) accepted += "flip of byte " + std::to_string(i) + "; ";
    bad = good;
    bad.resize(i);
    if (!contains(opener.fault(bad), "a.illum: ")) accepted += "truncation to " + std::to_string(i) + "; ";
  }
  CHECK_THAT(accepted, Catch::Equals(""));
}

TEST_CASE("schema: damaged illumination with a valid hash neither crashes nor throws other exceptions") {
  const Opener opener;
  const std::vector<std::byte> good = smallFile().encode();
  for (std::size_t i = 32; i < good.size(); ++i)
    for (const int value : {0x00, 0x01, 0x7f, 0xff}) {
      std::vector<std::byte> bad = good;
      bad[i] = static_cast<std::byte>(value);
      reseal(bad);
      opener.fault(bad);
    }
}

TEST_CASE("schema: illumination files of other versions and of other kinds are rejected") {
  const Opener opener;
  std::vector<std::byte> bytes = smallFile().encode();
  const auto [kind, major, minor] = kIlluminationFormat;
  setVersion(bytes, major, minor + 1);
  CHECK(opener.fault(bytes).empty());
  setVersion(bytes, major + 1, 0);
  CHECK(contains(opener.fault(bytes), "use a newer Lobe"));
  setVersion(bytes, major - 1, 0);
  CHECK(contains(opener.fault(bytes), "make the file again"));
  bytes = wrapPayload(kLobeFormat, {});
  CHECK(contains(opener.fault(bytes), "of kind 'BRDF', expected 'ILLU'"));
  CHECK(isOfKind(kLobeFormat, bytes));
  CHECK_FALSE(isOfKind(kIlluminationFormat, bytes));
  CHECK_FALSE(isOfKind(kLobeFormat, std::span(bytes).first(7)));
}

TEST_CASE("schema: invalid values in illumination files are rejected") {
  const Opener opener;
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  struct Fault {
    const char* words;
    std::function<void(Content&)> make;
  };
  const Fault faults[] = {
      {"not finite", [&](Content& c) { c.records[0].position[1] = nan; }},
      {"not finite", [&](Content& c) { c.records[0].radius = infinity; }},
      {"not finite", [&](Content& c) { c.records[0].samples = infinity; }},
      {"not orthonormal",
       [](Content& c) {
         c.records[0].normal = {0, 0, 1.1f};
       }},
      {"not orthonormal", [&](Content& c) { c.records[0].tangent[0] = nan; }},
      {"not orthonormal",
       [](Content& c) {
         c.records[0].tangent = {0, 0, 1};
       }},
      {"radius is not positive", [](Content& c) { c.records[1].radius = 0; }},
      {"radius over the unit", [](Content& c) { c.records[1].radius = 0.6f; }},
      {"background", [](Content& c) { c.records[1].background = 1.5f; }},
      {"background", [&](Content& c) { c.records[1].background = nan; }},
      {"negative irradiance", [](Content& c) { c.records[1].irradiance = -1; }},
      {"not finite", [&](Content& c) { c.records[1].irradiance = infinity; }},
      {"a likelihood gain is not finite", [&](Content& c) { c.likelihoodGains[1] = nan; }},
      {"number of likelihood gains", [](Content& c) { c.likelihoodGains.pop_back(); }},
      {"number of samples", [](Content& c) { c.records[1].samples = -1; }},
      {"no components", [](Content& c) { c.records[1].count = 0, c.records[1].background = 0.9f; }},
      {"BSDF sampling fraction", [](Content& c) { c.records[1].bsdfFraction = 0; }},
      {"BSDF sampling fraction", [](Content& c) { c.records[1].bsdfFraction = 1e-6f; }},
      {"BSDF sampling fraction", [](Content& c) { c.records[1].bsdfFraction = 1; }},
      {"BSDF sampling fraction", [&](Content& c) { c.records[0].bsdfFraction = nan; }},
      {"number of components", [](Content& c) { c.records[1].count = kMaxStoredComponents + 1; }},
      {"components out of range", [](Content& c) { c.records[0].first = 1; }},
      {"components out of range", [](Content& c) { c.records[0].first = 0xffffffffu; }},
      {"sum to one", [](Content& c) { c.components[1].weight = 0.3f; }},
      {"not positive definite", [](Content& c) { c.components[1].covXX = -0.01f; }},
      {"not positive definite",
       [](Content& c) {
         c.components[1].covXX = c.components[1].covYY = 1e-30f;
         c.components[1].covXY = 0;
       }},
      {"unit of length", [](Content& c) { c.info.unit = 0; }},
      {"unit of length", [&](Content& c) { c.info.unit = infinity; }},
      {"unit of length", [](Content& c) { c.info.unit = c.records[0].radius = c.records[1].radius = 1e-40f; }},
      {"undersampled", [](Content& c) { c.info.undersampledFraction = -1; }},
      {"length of paths", [](Content& c) { c.info.settings.maxDepth = -1; }},
  };
  for (const Fault& fault : faults) {
    Content content = smallFile();
    fault.make(content);
    CHECK_THAT(opener.fault(content.encode()), Catch::Contains(fault.words));
  }
}
