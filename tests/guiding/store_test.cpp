// Trained illumination survives being written to a file and read back.

#include <unistd.h>

#include <limits>

#include <catch2/catch.hpp>

#include "runtime/core/atomic_file.h"
#include "runtime/core/random.h"
#include "runtime/guiding/illumination_store.h"

using namespace lobe;

namespace {

IlluminationRecord randomRecord(Rng& rng) {
  IlluminationRecord r{};
  r.position = 10 * Vec3(rng.uniform(), rng.uniform(), rng.uniform());
  r.normal = Vec3(rng.uniform() - 0.5f, rng.uniform() - 0.5f, rng.uniform() + 0.1f).normalized();
  r.tangent = r.normal.unitOrthogonal();
  r.radius = 0.1f + 0.4f * rng.uniform();
  r.background = rng.uniform();
  r.irradiance = 5 * rng.uniform();
  r.samples = 1000 * rng.uniform();
  r.bsdfFraction = 0.05f + 0.9f * rng.uniform();
  r.likelihoodGain = rng.uniform() - 0.5f;
  r.count = static_cast<std::int32_t>(9 * rng.uniform());
  if (r.count == 0) r.background = 1;
  for (int k = 0; k < r.count; ++k)
    r.components[static_cast<std::size_t>(k)] = {1.0f / static_cast<float>(r.count),
                                                 rng.uniform() - 0.5f,
                                                 rng.uniform() - 0.5f,
                                                 {0.01f + rng.uniform(), 0.004f, 0.02f}};
  return r;
}

IlluminationCache writtenAndRead(const IlluminationCache& cache) {
  std::string name = (std::filesystem::temp_directory_path() / "lobe-illum-XXXXXX").string();
  const int file = mkstemp(name.data());
  REQUIRE(file >= 0);
  ::close(file);
  const std::vector<std::byte> bytes = storeIllumination(cache, {});
  writeAtomically(name, std::span<const std::byte>(bytes));
  IlluminationCache read = loadIllumination(IlluminationFile::open(name));
  std::filesystem::remove(name);
  return read;
}

bool sameRecord(const IlluminationRecord& a, const IlluminationRecord& b) {
  const auto same = [](const Gaussian& g, const Gaussian& h) {
    return g.weight == h.weight && g.meanX == h.meanX && g.meanY == h.meanY && g.cov.xx == h.cov.xx &&
           g.cov.xy == h.cov.xy && g.cov.yy == h.cov.yy;
  };
  return a.position == b.position && a.normal == b.normal && a.tangent == b.tangent && a.radius == b.radius &&
         a.background == b.background && a.irradiance == b.irradiance && a.samples == b.samples &&
         a.bsdfFraction == b.bsdfFraction && a.likelihoodGain == b.likelihoodGain &&
         std::ranges::equal(a.gaussians(), b.gaussians(), same);
}

}  // namespace

TEST_CASE("guiding: a stored cache has the same records and the same look-ups") {
  Rng rng(3, 0, 0);
  std::vector<IlluminationRecord> records;
  for (int i = 0; i < 300; ++i) records.push_back(randomRecord(rng));
  const IlluminationCache cache(records, 0.5f);
  const IlluminationCache read = writtenAndRead(cache);
  CHECK(read.unit() == cache.unit());
  const std::vector<IlluminationRecord> back = read.records();
  REQUIRE(back.size() == records.size());
  for (std::size_t i = 0; i < records.size(); ++i) REQUIRE(sameRecord(records[i], back[i]));

  int found = 0;
  for (int i = 0; i < 2000; ++i) {
    const IlluminationRecord& near = records[static_cast<std::size_t>(i) % records.size()];
    const auto offset = [&] { return Vec3(rng.uniform() - 0.5f, rng.uniform() - 0.5f, rng.uniform() - 0.5f); };
    const Vec3 x = near.position + offset(), n = (near.normal + 0.5f * offset()).normalized();
    const PackedRecord *a = cache.find(x, n), *b = read.find(x, n);
    REQUIRE((a == nullptr) == (b == nullptr));
    if (!a) continue;
    ++found;
    REQUIRE(a->index == b->index);
  }
  CHECK(found > 200);
  CHECK(found < 2000);
}

TEST_CASE("guiding: a cache without records can be stored") {
  const IlluminationCache read = writtenAndRead(IlluminationCache());
  CHECK(read.size() == 0);
  CHECK(read.find(Vec3::Zero(), Vec3::UnitZ()) == nullptr);
}

TEST_CASE("guiding: records and look-ups beyond the range of cell numbers are harmless") {
  // Undefined conversions to integers are found by the preset sanitize.
  Rng rng(4, 0, 0);
  std::vector<IlluminationRecord> records{randomRecord(rng), randomRecord(rng), randomRecord(rng)};
  const float far[] = {1e12f, -3e38f};
  for (int i = 0; i < 2; ++i) records[1 + i].position = Vec3(far[i], -far[i], 0);
  const IlluminationCache usual(records, 0.5f);
  CHECK(usual.find(records[0].position, records[0].normal));
  for (const float x : far) CHECK_FALSE(usual.find(Vec3(x, x, x), Vec3::UnitZ()));
  constexpr float kSmallest = std::numeric_limits<float>::min();
  for (IlluminationRecord& r : records) r.radius = kSmallest;
  const IlluminationCache smallest = writtenAndRead(IlluminationCache(records, kSmallest));
  for (const IlluminationRecord& r : records) CHECK_NOTHROW(smallest.find(r.position, r.normal));
}
