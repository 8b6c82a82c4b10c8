#include <algorithm>
#include <array>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <span>

#include <sys/resource.h>

#include "lobe_generated.h"
#include "runtime/core/atomic_file.h"
#include "schema/cache_checks.h"
#include "schema/checkpoint_file.h"
#include "schema/illumination_file.h"
#include "schema/lobe_cache.h"
#include "tests/support/schema_test_tools.h"

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

namespace {

struct Content {
  LobeCacheInfo info;
  std::vector<CacheRecord> records;
  std::vector<CacheComponent> components;
  std::vector<std::uint32_t> lookup;
  std::vector<std::byte> encode() const { return encodeLobeCache(info, records, components, lookup); }
};

Content smallCache() {
  Content c;
  c.info.toolVersion = "0.1.0";
  c.info.model = "test-model";
  c.info.key = "test-model;0x1p-3";
  c.info.summary = "a test";
  c.info.modelRevision = 3;
  c.info.gridKind = 0;
  c.info.gridCount = 2;
  c.records = {{0, 0, 1, 1.5f, 0.75f, 0.5f, 0.01f, 0.2f, 0.3f, 1.5f},
               {1, 1, 2, 1.25f, 0.5f, 0.25f, 0.02f, 0.4f, 0.6f, 3.0f}};
  c.components = {{1.0f, 0.1f, 0.2f, 0.03f, 0.01f, 0.04f},
                  {0.25f, -0.1f, 0.3f, 0.02f, 0.0f, 0.05f},
                  {0.75f, 0.4f, -0.2f, 0.01f, -0.005f, 0.06f}};
  c.lookup = {0, 1};
  return c;
}

struct Opener {
  TemporaryFolder folder;
  fs::path path = folder.path / "cache.lobe";

  /// The error message of opening a file with these bytes; empty if it succeeds.
  std::string fault(const std::vector<std::byte>& bytes) const {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    try {
      LobeCache::open(path);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return {};
  }
  std::string fault(const Content& content) const { return fault(content.encode()); }
};

}  // namespace

TEST_CASE("schema: a cache reads back as written") {
  const TemporaryFolder folder;
  const fs::path path = folder.path / "cache.lobe";
  const Content c = smallCache();
  const std::vector<std::byte> bytes = c.encode();
  REQUIRE(bytes == c.encode());
  writeAtomically(path, bytes);
  const LobeCache cache = LobeCache::open(path);
  CHECK(cache.info().key == c.info.key);
  CHECK(cache.info().model == c.info.model);
  CHECK(cache.info().summary == c.info.summary);
  CHECK(cache.info().toolVersion == c.info.toolVersion);
  CHECK(cache.info().modelRevision == 3);
  CHECK(cache.info().settings == c.info.settings);
  CHECK(cache.bytes() == bytes.size());
  CHECK(cache.header().major == kLobeFormat.major);
  REQUIRE(cache.records().size() == 2);
  CHECK(std::ranges::equal(std::as_bytes(cache.records()), std::as_bytes(std::span(c.records))));
  CHECK(std::ranges::equal(std::as_bytes(cache.components()), std::as_bytes(std::span(c.components))));
  for (std::uint32_t i = 0; i < 2; ++i) CHECK(cache.lookup(i) == c.lookup[i]);
  CHECK(cache.components(cache.records()[1]).size() == 2);
  CHECK(cache.components(cache.records()[1]).data() == cache.components().data() + 1);
}

TEST_CASE("schema: the layout of cache records matches the FlatBuffers schema") {
  const CacheComponent c{1, 2, 3, 4, 5, 6};
  const auto fc = std::bit_cast<fb::Component>(c);
  CHECK((fc.weight() == 1 && fc.mean_x() == 2 && fc.mean_y() == 3));
  CHECK((fc.cov_xx() == 4 && fc.cov_xy() == 5 && fc.cov_yy() == 6));
  const CacheRecord r{10, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  const auto fr = std::bit_cast<fb::Record>(r);
  CHECK((fr.entry() == 10 && fr.first() == 1 && fr.count() == 2 && fr.integral() == 3 && fr.albedo() == 4));
  CHECK((fr.cosine_mass() == 5 && fr.outside() == 6 && fr.nev() == 7 && fr.nev_coverage() == 8));
  CHECK(fr.worst_ratio() == 9);
}

TEST_CASE("schema: caches with a flipped bit or truncated are rejected") {
  const Opener opener;
  const std::vector<std::byte> good = smallCache().encode();
  REQUIRE(opener.fault(good).empty());
  std::string accepted;
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::vector<std::byte> bad = good;
    bad[i] ^= static_cast<std::byte>(1u << (i % 8));
    if (!contains(opener.fault(bad), "cache.lobe: ")) accepted += "flip of byte " + std::to_string(i) + "; ";
    bad = good;
    bad[i] = ~bad[i];
    if (!contains(opener.fault(bad), "cache.lobe: ")) accepted += "inversion of byte " + std::to_string(i) + "; ";
    bad = good;
    bad.resize(i);
    if (!contains(opener.fault(bad), "cache.lobe: ")) accepted += "truncation to " + std::to_string(i) + "; ";
  }
  CHECK_THAT(accepted, Catch::Equals(""));
}

TEST_CASE("schema: damaged caches with a valid hash neither crash nor throw other exceptions") {
  const Opener opener;
  const std::vector<std::byte> good = smallCache().encode();
  for (std::size_t i = 32; i < good.size(); ++i) {
    for (const int value : {0x00, 0x01, 0x7f, 0x80, 0xff}) {
      std::vector<std::byte> bad = good;
      bad[i] = static_cast<std::byte>(value);
      reseal(bad);
      opener.fault(bad);
    }
  }
  for (std::size_t size = 32; size < good.size(); ++size) {
    std::vector<std::byte> bad(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    reseal(bad);
    CHECK(contains(opener.fault(bad), "damaged"));
  }
}

TEST_CASE("schema: vectors that are not aligned are rejected") {
  // The size of the vector, 1, before an element of 8 bytes; and of an empty one.
  alignas(8) std::array<std::uint32_t, 5> words{1, 1, 7, 0, 0};
  const auto read = [&](std::size_t word) {
    return inPlace<std::uint64_t>(reinterpret_cast<const flatbuffers::Vector<std::uint64_t>&>(words[word]), "a.ckpt");
  };
  CHECK(read(1)[0] == 7);
  CHECK(read(4).empty());
  CHECK_THROWS_WITH(read(0), "a.ckpt: damaged: a vector is not aligned");
}

TEST_CASE("schema: errors name the kind of fault") {
  const Opener opener;
  const std::vector<std::byte> good = smallCache().encode();
  std::vector<std::byte> bytes = good;

  CHECK(contains(opener.fault(std::vector<std::byte>{}), "is empty"));
  CHECK(contains(opener.fault(std::vector<std::byte>(200, std::byte{'x'})), "not a Lobe file"));
  bytes.resize(20);
  CHECK(contains(opener.fault(bytes), "truncated"));
  bytes = good;
  bytes.resize(good.size() - 1);
  CHECK(contains(opener.fault(bytes), "truncated"));
  bytes = good;
  bytes.push_back(std::byte{0});
  CHECK(contains(opener.fault(bytes), "damaged"));
  bytes = good;
  bytes.back() ^= std::byte{1};
  CHECK(contains(opener.fault(bytes), "hash"));
  bytes = good;
  std::memcpy(bytes.data() + 4, "ILLU", 4);
  CHECK(contains(opener.fault(bytes), "kind 'ILLU'"));
  CHECK_THROWS_WITH(LobeCache::open(opener.folder.path), Catch::Contains("is a folder"));
  CHECK_THROWS_WITH(LobeCache::open(opener.folder.path / "none.lobe"), Catch::Contains("no such file"));
}

TEST_CASE("schema: a cache that has been read does not depend on its file any more") {
  const Opener opener;
  writeAtomically(opener.path, std::span<const std::byte>(smallCache().encode()));
  const LobeCache cache = LobeCache::open(opener.path);
  const std::vector<CacheRecord> before(cache.records().begin(), cache.records().end());
  std::filesystem::resize_file(opener.path, 0);
  CHECK(std::ranges::equal(std::as_bytes(cache.records()), std::as_bytes(std::span(before))));
  CHECK(cache.lookup(0) < before.size());
}

TEST_CASE("schema: a newer minor version is read and another major version rejected") {
  const Opener opener;
  std::vector<std::byte> bytes = smallCache().encode();
  setVersion(bytes, kLobeFormat.major, kLobeFormat.minor + 1);
  CHECK(opener.fault(bytes).empty());
  setVersion(bytes, kLobeFormat.major + 1, 0);
  CHECK(contains(opener.fault(bytes), "use a newer Lobe"));
  setVersion(bytes, kLobeFormat.major - 1, 0);
  CHECK(contains(opener.fault(bytes), "make the file again"));
}

TEST_CASE("schema: invalid values in caches are rejected") {
  const Opener opener;
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  struct Fault {
    const char* words;
    std::function<void(Content&)> make;
  };
  const Fault faults[] = {
      {"sum to one", [](Content& c) { c.components[1].weight = 0.3f; }},
      {"negative weight", [](Content& c) { c.components[1].weight = -0.25f; }},
      {"not finite", [&](Content& c) { c.components[0].weight = nan; }},
      {"not finite", [&](Content& c) { c.components[0].meanX = nan; }},
      {"not finite", [](Content& c) { c.components[0].covYY = std::numeric_limits<float>::infinity(); }},
      {"not positive definite", [](Content& c) { c.components[2].covXY = 0.0246f; }},
      {"not positive definite", [](Content& c) { c.components[2].covXX = -0.01f; }},
      {"not positive definite", [](Content& c) { c.components[2] = {0.75f, 0, 0, 0, 0, 0}; }},
      {"components out of range", [](Content& c) { c.records[1].first = 2; }},
      {"components out of range", [](Content& c) { c.records[1].first = 0xffffffffu; }},
      {"components out of range",
       [](Content& c) { c.records[1].count = 0, c.records[1].cosineMass = 0, c.records[1].first = 1000; }},
      {"direction out of range", [](Content& c) { c.records[1].entry = 2; }},
      {"record out of range", [](Content& c) { c.lookup[0] = 2; }},
      {"number of components", [](Content& c) { c.records[0].count = kMaxCacheComponents + 1; }},
      {"not finite", [&](Content& c) { c.records[0].nev = nan; }},
      {"not finite", [&](Content& c) { c.records[0].worstRatio = nan; }},
      {"negative quantity", [](Content& c) { c.records[0].integral = -1; }},
      {"negative quantity", [](Content& c) { c.records[1].worstRatio = -1; }},
      {"outside the disc", [](Content& c) { c.records[0].outside = 1.5f; }},
      {"cosine mass", [](Content& c) { c.records[0].cosineMass = 0; }},
      {"look-ups for a grid", [](Content& c) { c.info.gridCount = 3; }},
      {"unknown kind", [](Content& c) { c.info.gridKind = 2; }},
      {"look-ups for a grid", [](Content& c) { c.info.gridCount = 0, c.records.clear(); }},
      {"damaged: fitted to 4294967295 samples", [](Content& c) { c.info.settings.samples = 0xffffffffu; }},
      {"samples: out of range", [](Content& c) { c.info.settings.samples = kMaxFitSamples + 1; }},
      {"reduction or quality", [&](Content& c) { c.info.settings.reduction = nan; }},
      {"reduction or quality", [](Content& c) { c.info.settings.reduction = -0.1f; }},
      {"reduction or quality", [&](Content& c) { c.info.settings.quality = infinity; }},
      {"reduction or quality", [](Content& c) { c.info.settings.quality = -1; }},
  };
  for (const Fault& fault : faults) {
    Content content = smallCache();
    fault.make(content);
    CHECK_THAT(opener.fault(content), Catch::Contains(fault.words));
  }
  Content most = smallCache();
  most.info.settings.samples = kMaxFitSamples;
  most.info.settings.reduction = most.info.settings.quality = std::numeric_limits<float>::max();
  CHECK(opener.fault(most).empty());
}

TEST_CASE("schema: files are written completely or not at all") {
  const TemporaryFolder folder;
  const fs::path path = folder.path / "out.png";
  writeAtomically(path, std::string("first"));
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{10, limit.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  CHECK_THROWS_WITH(writeAtomically(path, std::string(100, 'x')), path.string() + ": cannot write: File too large");
  setrlimit(RLIMIT_FSIZE, &limit);
  std::signal(SIGXFSZ, before);
  std::string text;
  std::ifstream(path) >> text;
  CHECK(text == "first");
  CHECK(folder.fileCount() == 1);
  CHECK_THROWS_WITH(writeAtomically(folder.path / "none" / "x", std::string("x")), Catch::Contains("none/x"));
  CHECK_THROWS_WITH(writeAtomically(folder.path, std::string("x")), Catch::Contains("is a directory"));
  CHECK_THROWS_WITH(writeAtomically("/dev/null", std::string("x")), Catch::Contains("not a regular file"));
}

TEST_CASE("schema: writing to a symbolic link replaces its target") {
  const TemporaryFolder folder;
  writeAtomically(folder.path / "real", std::string("older"));
  fs::permissions(folder.path / "real", fs::perms::owner_read | fs::perms::owner_write);
  writeAtomically(folder.path / "real", std::string("old"));
  CHECK(fs::status(folder.path / "real").permissions() == (fs::perms::owner_read | fs::perms::owner_write));
  fs::create_symlink("real", folder.path / "link");
  writeAtomically(folder.path / "link", std::string("new"));
  CHECK(fs::is_symlink(folder.path / "link"));
  std::string text;
  std::ifstream(folder.path / "real") >> text;
  CHECK(text == "new");
}

TEST_CASE("schema: writing to a dangling symbolic link creates its target") {
  const TemporaryFolder folder;
  fs::create_directory(folder.path / "renders");
  fs::create_symlink("renders/picture", folder.path / "first");
  fs::create_symlink("first", folder.path / "link");
  checkWritable(folder.path / "link");
  writeAtomically(folder.path / "link", std::string("new"));
  CHECK(fs::is_symlink(folder.path / "link"));
  std::string text;
  std::ifstream(folder.path / "renders" / "picture") >> text;
  CHECK(text == "new");
  fs::create_symlink("loop", folder.path / "loop");
  CHECK_THROWS_WITH(writeAtomically(folder.path / "loop", std::string("x")), Catch::Contains("loop: cannot write"));
}

TEST_CASE("schema: content that is too large for a file is refused before it is encoded") {
  constexpr std::size_t kLimit = (std::size_t{1} << 31) - 1;  // checkBufferPlace refuses such payloads
  CHECK(bufferSize(100, "they") > 100);
  CHECK(bufferSize(kLimit - (1 << 21), "they") < kLimit);
  for (const std::size_t size : {kLimit - 1, kLimit, 4 * kLimit})
    CHECK_THROWS_WITH(bufferSize(size, "they"), "they are too large: a file holds less than 2 GiB");
  // Views of more than there is; only their sizes are used.
  const auto tooMany = []<class T>(const T& one) { return std::span(&one, kLimit / sizeof(T) + 1); };
  const CacheRecord record{};
  const CacheComponent component{};
  const StoredIllumination illumination{};
  const StoredPixel pixel{};
  const std::uint32_t entry = 0;
  const auto isTooLarge = Catch::Contains("too large");
  CHECK_THROWS_WITH(encodeLobeCache({}, tooMany(record), {}, {}), isTooLarge);
  CHECK_THROWS_WITH(encodeLobeCache({}, {}, tooMany(component), {}), isTooLarge);
  CHECK_THROWS_WITH(encodeLobeCache({}, {}, {}, tooMany(entry)), isTooLarge);
  CHECK_THROWS_WITH(encodeIllumination({}, tooMany(illumination), {}), isTooLarge);
  CHECK_THROWS_WITH(encodeIllumination({}, {}, tooMany(component)), isTooLarge);
  CHECK_THROWS_WITH(encodeCheckpoint({}, tooMany(pixel), {}, {}), isTooLarge);
}

TEST_CASE("schema: the file name depends only on model and key") {
  CHECK(lobeFileName("ggx", "a") == lobeFileName("ggx", "a"));
  CHECK(lobeFileName("ggx", "a") != lobeFileName("ggx", "b"));
  CHECK(contains(lobeFileName("ggx", "a"), ".lobe"));
}
