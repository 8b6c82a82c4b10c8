// Sampling of products of trained records and fitted caches of a real scene, tested against the reported density.

#include <catch2/catch.hpp>

#include "runtime/guiding/brdf_caches.h"
#include "tests/support/mixtures_chi2.h"
#include "tests/support/studio.h"

using namespace lobe;
using lobe::test::ofMixtures;
using lobe::test::Studio;

namespace {

constexpr int kRecords = 20, kReflectances = 5;
constexpr Chi2Options kFew{.samples = 20000, .bins = 64};

BrdfCaches cachesOf(const Studio& studio) {
  return {studio.lobes(), lobeRequests(studio.scene()), "lobefit"};
}

/// Reflectances of different lobes and directions that have components, rotated into a random tangent frame.
std::vector<Reflectance> someReflectances(const Studio& studio) {
  const BrdfCaches caches = cachesOf(studio);
  const int lobes = static_cast<int>(lobeRequests(studio.scene()).size());
  std::vector<Reflectance> found;
  Rng rng(31);
  while (static_cast<int>(found.size()) < kReflectances) {
    const float z = 0.1f + 0.9f * rng.uniform(), r = std::sqrt(1 - z * z);
    const Vec2 azimuth = Eigen::Rotation2Df(6.28f * rng.uniform()) * Vec2::UnitX(),
               turn = Eigen::Rotation2Df(6.28f * rng.uniform()) * Vec2::UnitX();
    Reflectance reflectance;
    // Every second reflectance has a diffuse part.
    reflectance.constant = found.size() % 2 == 0 ? 0.1f : 0.0f;
    reflectance.backgroundMass = reflectance.constant;
    const int lobe = static_cast<int>(found.size()) * lobes / kReflectances;
    caches.add(lobe, {r * azimuth.x(), r * azimuth.y(), z}, turn, 0.7f, reflectance);
    if (reflectance.gaussians.count() > 0) found.push_back(reflectance);
  }
  return found;
}

}  // namespace

TEST_CASE("unbiased: lobes are looked up at the nearest elevation") {
  const Studio studio(readScene(std::filesystem::path(LOBE_SOURCE_DIR) / "scenes/jewelry.xml"), 60, 40);
  const std::vector<LobeRequest> requests = lobeRequests(studio.scene());
  const BrdfCaches caches = cachesOf(studio);
  int elevations = 0, others = 0;
  for (std::size_t lobe = 0; lobe < requests.size(); ++lobe) {
    const LobeCache cache = LobeCache::open(studio.lobes() / lobeFileName(requests[lobe].model, requests[lobe].key));
    const DirectionGrid grid{static_cast<GridKind>(cache.info().gridKind), static_cast<int>(cache.info().gridCount)};
    if (grid.kind != GridKind::elevation) continue;
    for (int i = 0; i < 1000; ++i, ++elevations) {
      const float theta = 1.57f * (static_cast<float>(i) + 0.5f) / 1000;
      const Vec3 wo(0, std::sin(theta), std::cos(theta));
      Reflectance reflectance;
      caches.add(static_cast<int>(lobe), wo, Vec2::UnitX(), 1, reflectance);
      const CacheRecord& expected = cache.records()[cache.lookup(static_cast<std::uint32_t>(grid.nearest(wo)))];
      others += reflectance.albedo + reflectance.unrepresentableAlbedo != expected.albedo;
    }
  }
  CHECK(elevations >= 1000);
  CHECK(others <= elevations / 1000);  // differences in rounding halfway between two elevations
}

TEST_CASE("unbiased: samples of trained records and fitted lobes follow the reported density", "[slow]") {
  const Studio studio(readScene(std::filesystem::path(LOBE_SOURCE_DIR) / "scenes/jewelry.xml"), 60, 40);
  const std::vector<Reflectance> reflectances = someReflectances(studio);
  const std::vector<IlluminationRecord> records = studio.illumination().records();
  REQUIRE(records.size() >= kRecords);
  int mutantsSeen = 0;
  for (std::size_t i = 0; i < kRecords; ++i) {
    const IlluminationRecord& record = records[i * records.size() / kRecords];
    const IlluminationCache alone({record}, studio.illumination().unit());
    const PackedRecord& packed = *alone.find(record.position, record.normal);
    for (std::size_t j = 0; j < reflectances.size(); ++j) {
      const GuidedDensity density(reflectances[j], packed, productProbabilities(packed.bsdfFraction));
      const Chi2Result result = ofMixtures(density, i * kReflectances + j, kFew);
      INFO("record " << i << ", reflectance " << j << ": " << result.message);
      CHECK(result.passed(kRecords * kReflectances));
      if (j == 0 && i % 4 == 0) mutantsSeen += !ofMixtures(density, i, kFew, 1.1f).passed(kRecords * kReflectances);
    }
  }
  CHECK(mutantsSeen == kRecords / 4);
}
