// Files of earlier versions are read by every later one. A new minor version of a format adds a file of its own here,
// and keeps these; tests/data/room.xml is the scene that they were made from.

#include <filesystem>

#include <catch2/catch.hpp>

#include "lobe/surface_distribution.h"
#include "runtime/guiding/field_data.h"
#include "schema/illumination_file.h"
#include "schema/lobe_cache.h"
#include "tests/support/tool_run.h"

using namespace lobe;

namespace {

const std::filesystem::path kData = std::filesystem::path(LOBE_SOURCE_DIR) / "tests/data";

}  // namespace

TEST_CASE("fixtures: a BRDF cache of version 0.2") {
  const LobeCache cache = LobeCache::open(kData / "ggx-0.2.lobe");
  CHECK(cache.header().major == 3);
  CHECK(cache.info().toolVersion == "0.2.0");
  CHECK(cache.info().model == "ggx-conductor");
  CHECK(cache.info().settings.method == FitMethod::wem);
  CHECK(cache.info().settings.components == 3);
  REQUIRE(cache.records().size() == 24);
  const CacheRecord& r = cache.records()[10];
  CHECK(r.count == 3);
  CHECK(r.integral == Approx(1.71121).epsilon(1e-5));
  CHECK(r.albedo == Approx(0.879482).epsilon(1e-5));
  CHECK(cache.components(r)[0].meanX == Approx(-0.276632).epsilon(1e-5));
}

TEST_CASE("fixtures: a cache of version 0.2 is found by its key and sampled") {
  const test::Folder folder;
  const LobeCache cache = LobeCache::open(kData / "ggx-0.2.lobe");
  const LobeCacheInfo& info = cache.info();
  std::filesystem::copy(kData / "ggx-0.2.lobe", folder / lobeFileName(info.model, info.key));
  const std::vector<LobeRequest> requests{{info.model, info.key, info.modelRevision, "metal"}};
  const LobeCacheSet caches(folder.path(), requests, "");
  CHECK(caches.meanComponents() == Approx(2.83).margin(0.01));
}

TEST_CASE("fixtures: illumination of version 0.2") {
  const IlluminationFile file = IlluminationFile::open(kData / "room-0.2.illum");
  CHECK(file.header().major == 2);
  CHECK(file.info().toolVersion == "0.2.0");
  const Field field = Field::load(kData / "room-0.2.illum");
  REQUIRE(field.records() == 218);
  const IlluminationRecord r = cacheOf(field).records()[7];
  CHECK(r.count == 3);
  CHECK(r.position.x() == Approx(0.707567).epsilon(1e-5));
  CHECK(r.irradiance == Approx(4363.52).epsilon(1e-5));
  CHECK(r.background == Approx(0.903197).epsilon(1e-5));
  CHECK(r.likelihoodGain == 0);  // such files do not have it
  CHECK(r.components[0].meanX == Approx(0.14799).epsilon(1e-4));
}
