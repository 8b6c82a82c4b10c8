// The public interface of the guiding library.

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <stdexcept>
#include <vector>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <catch2/catch.hpp>

#include "lobe/field.h"
#include "lobe/fitting.h"
#include "lobe/path_recorder.h"
#include "lobe/surface_distribution.h"
#include "runtime/core/random.h"
#include "runtime/guiding/field_data.h"
#include "runtime/guiding/sample_storage_data.h"
#include "tests/support/tool_run.h"

using namespace lobe;

namespace {

constexpr float kPi = 3.14159265f;

FieldOptions smallField() {
  FieldOptions options;
  options.sceneDiagonal = 10;
  options.unitFraction = 0.1f;
  return options;
}

/// Adds a photon at a random position on the unit square of the floor z = 0, from about the direction (0.6, 0, 0.8),
/// and a request for a record there.
void addPath(SampleStorage& storage, std::uint64_t index) {
  Rng rng(5, 0, index);
  const Float3 position{rng.uniform(), rng.uniform(), 0};
  const Vec3 direction = Vec3(0.6f + 0.1f * rng.uniform(), 0.1f * rng.uniform(), 0.8f).normalized();
  storage.beginPath(index);
  storage.addPhoton(position, {0, 0, 1}, {direction.x(), direction.y(), direction.z()}, 0.5f + rng.uniform(), 3, 1);
  storage.requestRecord(position, {0, 0, 1});
}

SampleStorage paths(const std::vector<int>& indices) {
  SampleStorage storage;
  for (const int i : indices) addPath(storage, static_cast<std::uint64_t>(i));
  return storage;
}

Field trained() {
  std::vector<int> all(2000);
  for (int i = 0; i < 2000; ++i) all[static_cast<std::size_t>(i)] = i;
  Field field(smallField());
  field.update(paths(all));
  return field;
}

ShadingPoint floorAt(float x, float y) {
  return {{x, y, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 1}};
}

/// Whether this thread is in a call of the library.
thread_local bool inLibrary = false;

}  // namespace

TEST_CASE("guiding: a thread that waits for the library runs no tasks of the host") {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  std::atomic<int> nested = 0, records = 0;
  tbb::parallel_for(0, 200, [&](int) {
    nested += inLibrary ? 1 : 0;
    std::vector<SampleStorage> parts;
    for (int i = 0; i < 4; ++i) {
      std::vector<int> some(300);
      std::iota(some.begin(), some.end(), 300 * i);
      parts.push_back(paths(some));
    }
    Field field(smallField());
    SampleStorage all;
    inLibrary = true;
    all.merge(parts);
    field.update(all);
    field.refit();
    field.fill(all, all);
    inLibrary = false;
    records += static_cast<int>(field.records());
  });
  CHECK(nested == 0);
  CHECK(records > 0);
}

TEST_CASE("guiding: a field does not depend on the assignment of paths to threads") {
  std::vector<int> even, odd;
  for (int i = 0; i < 1000; ++i) (i % 2 == 0 ? even : odd).push_back(i);
  const test::Folder folder;
  for (const bool evenFirst : {true, false}) {
    SampleStorage a = paths(evenFirst ? even : odd), b = paths(evenFirst ? odd : even);
    a.merge(std::move(b));
    CHECK(a.particles() == 1000);
    Field field(smallField());
    field.update(a);
    REQUIRE(field.records() > 3);
    field.save(folder / (evenFirst ? "a.illum" : "b.illum"));
  }
  CHECK(test::readFile(folder / "a.illum") == test::readFile(folder / "b.illum"));
}

TEST_CASE("guiding: a loaded field equals the saved one and cannot be trained further") {
  const test::Folder folder;
  const Field field = trained();
  field.save(folder / "a.illum");
  Field loaded = Field::load(folder / "a.illum");
  CHECK(loaded.records() == field.records());
  loaded.save(folder / "b.illum");
  CHECK(test::readFile(folder / "a.illum") == test::readFile(folder / "b.illum"));
  CHECK_THROWS_AS(loaded.update(paths({1, 2})), std::logic_error);
  CHECK_THROWS_WITH(Field::load(folder / "none.illum"), Catch::Contains("none.illum"));
  FieldOptions options;
  options.components = 9;
  CHECK_THROWS_WITH(Field(options), Catch::Contains("components"));
}

TEST_CASE("guiding: a lobe and the request for its cache have the same revision unless it is set") {
  const LobeRequest request{.model = "phong", .key = "phong exponent=60", .material = "glossy"};
  CHECK(request.revision == LobeFunctions().revision);
}

TEST_CASE("guiding: without a record only the BSDF is sampled") {
  const Field field = trained();
  const SurfaceDistribution nowhere(field, floorAt(100, 100));
  CHECK(!nowhere.hasRecord());
  CHECK(nowhere.decision() == GuidingDecision::noRecord);
  CHECK(nowhere.bsdfProbability() == 1);
  CHECK(nowhere.guidedPdf({0, 0, 1}) == 0);
  float choice = 0.7f;
  CHECK(nowhere.choose(choice) == Strategy::bsdf);
  CHECK(choice == 0.7f);
  CHECK(!nowhere.reflectedRadiance(1));
}

TEST_CASE("guiding: the distribution at a surface integrates to one and samples towards the light") {
  const Field field = trained();
  SurfaceDistribution guide(field, floorAt(0.5f, 0.5f));
  REQUIRE(guide.hasRecord());
  guide.describe({.lobes = {}, .diffuseAlbedo = 0.5f}, nullptr);
  CHECK(guide.decision() == GuidingDecision::illumination);
  constexpr int kRings = 400;
  double mass = guide.bsdfProbability();
  for (int i = 0; i < kRings; ++i)
    for (int j = 0; j < 4 * kRings; ++j) {
      const float z = (static_cast<float>(i) + 0.5f) / kRings,
                  phi = 2 * kPi * (static_cast<float>(j) + 0.5f) / (4 * kRings);
      const float r = std::sqrt(1 - z * z);
      mass += guide.guidedPdf({r * std::cos(phi), r * std::sin(phi), z}) * 2 * kPi / (4.0 * kRings * kRings);
    }
  CHECK(mass == Approx(1).epsilon(0.01));
  Rng rng(1);
  int guided = 0, towards = 0;
  for (int i = 0; i < 2000; ++i) {
    float choice = rng.uniform();
    const Strategy strategy = guide.choose(choice);
    if (strategy == Strategy::bsdf) continue;
    const auto sample = guide.sample(strategy, choice, {rng.uniform(), rng.uniform()});
    if (!sample) continue;
    ++guided;
    CHECK(sample->guidedPdf == Approx(guide.guidedPdf(sample->wi)).epsilon(1e-3));
    if (sample->wi.x * 0.63f + sample->wi.z * 0.78f > 0.95f) ++towards;
  }
  CHECK(guided == Approx(1000).margin(120));
  CHECK(towards > 0.9 * guided);
}

TEST_CASE("guiding: a recorded path gives each vertex its incident radiance") {
  SampleStorage storage;
  PathRecorder recorder(storage);
  recorder.begin(3);
  recorder.setDistance(7);  // from the camera to the first vertex
  const float h = std::sqrt(0.5f);
  // The throughput is 0.5 after the first vertex and 0.1 after the second; the path finds light of 1 and then of 0.8.
  recorder.addVertex({.position = {0, 0, 0},
                      .normal = {0, 0, -1},
                      .direction = {h, 0, h},
                      .wi = {h, 0, h},
                      .pdf = 0.25f,
                      .weight = {0.5f, 0.5f, 0.5f},
                      .throughput = {0.5f, 0.5f, 0.5f}},
                     nullptr);
  recorder.setDistance(2);
  recorder.setDistance(5);  // after delta scattering, which adds no vertex
  recorder.addLight({1, 1, 1});
  recorder.addVertex({.position = {1, 0, 1},
                      .normal = {0, 0, 1},
                      .direction = {0, 0, 1},
                      .wi = {0, 0, 1},
                      .pdf = 0.5f,
                      .weight = {0.2f, 0.2f, 0.2f},
                      .throughput = {0.1f, 0.1f, 0.1f}},
                     nullptr);
  recorder.addLight({0.8f, 0.8f, 0.8f});
  recorder.end();
  const std::vector<Particle>& samples = dataOf(storage).samples;
  REQUIRE(samples.size() == 2);
  CHECK(samples[0].weight == Approx(h / 0.25f * (1 / 0.5f + 0.8f / 0.5f)));
  CHECK(samples[0].normal.z() == 1);  // flipped to the side of the direction
  CHECK(samples[0].distance == 2);
  CHECK(samples[1].weight == Approx(1 / 0.5f * 8));
  CHECK(samples[1].distance == std::numeric_limits<float>::infinity());
}

TEST_CASE("guiding: a vertex without the density of the BSDF is no sample for the BSDF sampling fraction") {
  const Field field = trained();
  const LobeCacheSet caches("", {}, "");
  SurfaceDistribution guide(field, floorAt(0.5f, 0.5f));
  guide.describe({.lobes = {}, .diffuseAlbedo = 0.5f}, &caches);
  REQUIRE(guide.learnsFraction());
  const auto samplesWith = [&](float bsdfPdf) {
    SampleStorage storage;
    PathRecorder recorder(storage);
    recorder.begin(0);
    recorder.addVertex({.position = {0.5f, 0.5f, 0},
                        .normal = {0, 0, 1},
                        .direction = {0.6f, 0, 0.8f},
                        .wi = {0.6f, 0, 0.8f},
                        .pdf = 1,
                        .bsdfPdf = bsdfPdf,
                        .weight = {0.5f, 0.5f, 0.5f},
                        .throughput = {0.5f, 0.5f, 0.5f}},
                       &guide);
    recorder.addLight({1, 1, 1});
    recorder.end();
    CHECK(storage.particles() == 1);
    return dataOf(storage).fractions.size();
  };
  CHECK(samplesWith(0.25f) == 1);
  CHECK(samplesWith(0) == 0);
  CHECK(samplesWith(std::numeric_limits<float>::infinity()) == 0);
  CHECK(samplesWith(std::numeric_limits<float>::quiet_NaN()) == 0);
}

TEST_CASE("guiding: the part of the reflection that mixtures do not represent is left to the BSDF") {
  const Field field = trained();
  for (const float undescribed : {0.0f, 0.4f, 1.0f}) {
    CAPTURE(undescribed);
    SurfaceDistribution guide(field, floorAt(0.5f, 0.5f));
    guide.describe({.lobes = {}, .diffuseAlbedo = 0.5f, .undescribedFraction = undescribed}, nullptr);
    CHECK(guide.bsdfProbability() == Approx(1 - 0.5f * (1 - undescribed)));
    int guided = 0;
    for (int i = 0; i < 1000; ++i) {
      float choice = (static_cast<float>(i) + 0.5f) / 1000;
      guided += guide.choose(choice) != Strategy::bsdf;
    }
    CHECK(guided == Approx(500 * (1 - undescribed)).margin(2));
    // What the undescribed part reflects cannot be estimated.
    CHECK(guide.reflectedRadiance(0.5f).has_value() == (undescribed == 0));
  }
}

TEST_CASE("guiding: an undescribed fraction out of range counts as the nearest one, and NaN as one") {
  const Field field = trained();
  const auto bsdfProbability = [&](float undescribed) {
    SurfaceDistribution guide(field, floorAt(0.5f, 0.5f));
    guide.describe({.lobes = {}, .diffuseAlbedo = 0.5f, .undescribedFraction = undescribed}, nullptr);
    CHECK(std::isfinite(guide.guidedPdf({0.6f, 0, 0.8f})));
    return guide.bsdfProbability();
  };
  CHECK(bsdfProbability(-0.1f) == 0.5f);
  CHECK(bsdfProbability(1.0000001f) == 1);
  CHECK(bsdfProbability(std::numeric_limits<float>::infinity()) == 1);
  CHECK(bsdfProbability(std::numeric_limits<float>::quiet_NaN()) == 1);
}

TEST_CASE("guiding: a record that has only seen photons without weight is not sampled") {
  SampleStorage storage;
  storage.beginPath(1000);
  storage.requestRecord(floorAt(0.5f, 0.5f));
  Rng rng(4);
  for (std::uint64_t i = 0; i < 500; ++i) {
    storage.beginPath(i);
    const Float3 position{rng.uniform(), rng.uniform(), 0};
    storage.addPhoton(position, {0, 0, 1}, {0.6f, 0, 0.8f}, 0, 3, 1);  // of a light that next-event estimation finds
    storage.requestRecord(position, {0, 0, 1});
  }
  Field field(smallField());
  field.update(storage);
  const LobeCacheSet caches("", {}, "");
  for (const LobeCacheSet* set : {static_cast<const LobeCacheSet*>(nullptr), &caches}) {
    SurfaceDistribution guide(field, floorAt(0.5f, 0.5f));
    REQUIRE(guide.hasRecord());
    guide.describe({.lobes = {}, .diffuseAlbedo = 0.5f}, set);
    CHECK(guide.decision() == GuidingDecision::noRecord);
    CHECK(guide.bsdfProbability() == 1);
    CHECK(guide.guidedPdf({0.6f, 0, 0.8f}) == 0);
    CHECK(!guide.learnsFraction());
    CHECK(guide.reflectedRadiance(0.5f).value() > 0);  // the irradiance is known
  }
}

TEST_CASE("guiding: a lobe that the cache set does not have is refused") {
  const Field field = trained();
  const LobeCacheSet caches("", {}, "");
  for (const int lobe : {0, -1}) {
    SurfaceDistribution guide(field, floorAt(0.5f, 0.5f));
    const TintedLobe tinted{lobe, 0.5f};
    CHECK_THROWS_AS(guide.describe({.lobes = {&tinted, 1}, .diffuseAlbedo = 0.5f}, &caches), std::out_of_range);
  }
}

TEST_CASE("guiding: on the back of a surface, directions follow the light that arrives there") {
  // Light from below that no mirroring leaves in place. The field's frame is that of the world.
  const Vec3 light = Vec3(0.6f, 0.35f, -0.7f).normalized();
  SampleStorage storage;
  Rng rng(3);
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 d = (light + 0.05f * Vec3(rng.uniform(), rng.uniform(), rng.uniform())).normalized();
    storage.beginPath(i);
    const Float3 position{rng.uniform(), rng.uniform(), 0};
    storage.addPhoton(position, {0, 0, -1}, {d.x(), d.y(), d.z()}, 1, 3, 1);
    storage.requestRecord(position, {0, 0, -1});
  }
  Field field(smallField());
  field.update(storage);
  ShadingPoint below = floorAt(0.5f, 0.5f);
  below.wo = {0, 0, -1};
  CHECK(!SurfaceDistribution(field, floorAt(0.5f, 0.5f)).hasRecord());
  SurfaceDistribution guide(field, below);
  REQUIRE(guide.hasRecord());
  guide.describe({.lobes = {}, .diffuseAlbedo = 0.5f}, nullptr);
  const float towards = guide.guidedPdf({light.x(), light.y(), light.z()});
  CHECK(towards > 1);
  CHECK(guide.guidedPdf({light.x(), -light.y(), light.z()}) < 0.1f * towards);
  CHECK(guide.guidedPdf({-light.x(), light.y(), light.z()}) < 0.1f * towards);
  CHECK(guide.guidedPdf({-light.x(), -light.y(), light.z()}) < 0.1f * towards);
  CHECK(guide.guidedPdf({light.x(), light.y(), -light.z()}) == 0);
  int near = 0;
  for (int i = 0; i < 200; ++i) {
    const auto sample = guide.sample(Strategy::illumination, rng.uniform(), {rng.uniform(), rng.uniform()});
    near += sample && sample->wi.x * light.x() + sample->wi.y * light.y() + sample->wi.z * light.z() > 0.95f;
  }
  CHECK(near > 180);
}

TEST_CASE("guiding: a record is requested on the side of a point from which it is looked up") {
  SampleStorage storage;
  storage.beginPath(0);
  for (const float side : {1.0f, -1.0f}) {
    ShadingPoint point = floorAt(0.5f, 0.25f);
    point.wo = {0, 0, side};
    storage.requestRecord(point);
    CHECK(dataOf(storage).requests.back().position == Vec3(0.5f, 0.25f, 0));
    CHECK(dataOf(storage).requests.back().normal == Vec3(0, 0, side));
  }
}

TEST_CASE("guiding: the normals of requests are normalised") {
  std::vector<int> all(2000);
  std::iota(all.begin(), all.end(), 0);
  const SampleStorage particles = paths(all);
  SampleStorage requests;
  requests.beginPath(0);
  requests.requestRecord({0.5f, 0.5f, 0}, {0, 0, 0});
  requests.requestRecord({0.5f, 0.5f, 0}, {0, 0, std::numeric_limits<float>::quiet_NaN()});
  requests.requestRecord({0.5f, 0.5f, 0}, {0, 0, std::numeric_limits<float>::infinity()});
  CHECK(dataOf(requests).requests.empty());
  requests.requestRecord({0.5f, 0.5f, 0}, {0, 0, 1.001f});
  Field field(smallField());
  field.fill(requests, particles);
  REQUIRE(field.records() == 1);
  const test::Folder folder;
  field.save(folder / "a.illum");
  CHECK(Field::load(folder / "a.illum").records() == 1);
}

TEST_CASE("guiding: filling creates the missing records and keeps the others") {
  std::vector<int> all(2000);
  std::iota(all.begin(), all.end(), 0);
  const SampleStorage particles = paths(all);
  SampleStorage pass;  // the same photons with a request in one place only
  for (const int i : all) {
    Rng rng(5, 0, static_cast<std::uint64_t>(i));
    const Float3 position{rng.uniform(), rng.uniform(), 0};
    pass.beginPath(static_cast<std::uint64_t>(i));
    pass.addPhoton(position, {0, 0, 1}, {0.6f, 0, 0.8f}, 1, 3, 1);
    if (i == 0) pass.requestRecord({0.1f, 0.1f, 0}, {0, 0, 1});
  }
  Field field(smallField());
  field.update(pass);
  REQUIRE(field.records() == 1);
  const ShadingPoint missing = floorAt(0.95f, 0.95f), served = floorAt(0.1f, 0.1f);
  REQUIRE(!SurfaceDistribution(field, missing).hasRecord());
  SampleStorage requests;
  requests.beginPath(0);
  requests.requestRecord(missing.position, missing.normal);
  requests.requestRecord(served.position, served.normal);
  field.fill(requests, particles);
  CHECK(field.records() == 2);
  CHECK(SurfaceDistribution(field, missing).hasRecord());
  // Without particles nothing can be created.
  SampleStorage elsewhere;
  elsewhere.beginPath(0);
  elsewhere.requestRecord({5, 5, 0}, {0, 0, 1});
  field.fill(elsewhere, particles);
  CHECK(field.records() == 2);
}

TEST_CASE("guiding: a field with the records of an earlier one keeps them and adds others") {
  const Field earlier = trained();
  const std::vector<IlluminationRecord> before = cacheOf(earlier).records();
  // The same paths, and others on a part of the floor that has no records.
  SampleStorage storage;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    addPath(storage, 2 * i);
    Rng rng(6, 0, i);
    const Float3 position{5 + rng.uniform(), rng.uniform(), 0};
    storage.beginPath(2 * i + 1);
    storage.addPhoton(position, {0, 0, 1}, {0, 0.6f, 0.8f}, 1, 3, 1);
    storage.requestRecord(position, {0, 0, 1});
  }
  Field field(smallField(), earlier);
  CHECK(field.records() == earlier.records());
  field.update(storage);
  field.refit();
  field.fill(storage, storage);
  const std::vector<IlluminationRecord> after = cacheOf(field).records();
  REQUIRE(after.size() > before.size() + 3);
  for (std::size_t i = 0; i < before.size(); ++i) {
    CHECK(after[i].position == before[i].position);
    CHECK(after[i].samples == before[i].samples);
    CHECK(after[i].radius == before[i].radius);
    CHECK(after[i].components[0].meanX == before[i].components[0].meanX);
  }
  // Few of the others are on the part that had records.
  const auto added = std::ranges::count_if(after, [](const IlluminationRecord& r) { return r.position.x() < 2; });
  CHECK(static_cast<std::size_t>(added) < before.size() + before.size() / 5 + 2);
  CHECK(cacheOf(field).find({5.5f, 0.5f, 0}, {0, 0, 1}) != nullptr);
  CHECK(cacheOf(earlier).find({5.5f, 0.5f, 0}, {0, 0, 1}) == nullptr);
  CHECK(earlier.records() == before.size());
}

TEST_CASE("guiding: a field with larger records of an earlier one can be saved and loaded") {
  const Field earlier = trained();
  FieldOptions options = smallField();
  options.unitFraction = 0.001f;
  const Field field(options, earlier);
  const test::Folder folder;
  field.save(folder / "a.illum");
  CHECK(Field::load(folder / "a.illum").records() == earlier.records());
}

TEST_CASE("guiding: BSDF sampling fractions are learnt by the records that are added alone") {
  const std::vector<IlluminationRecord> kept = cacheOf(trained()).records();
  std::vector<Particle> particles;
  std::vector<RecordRequest> requests;
  for (int i = 0; i < 500; ++i) {
    Rng rng(6, 0, static_cast<std::uint64_t>(i));
    const Vec3 position(5 + rng.uniform(), rng.uniform(), 0);
    particles.push_back(
        {.position = position, .normal = Vec3::UnitZ(), .direction = Vec3(0, 0.6f, 0.8f), .weight = 1, .distance = 3});
    requests.push_back({position, Vec3::UnitZ()});
  }
  IlluminationTrainer trainer({.unitFraction = 0.1f}, 10, kept);
  trainer.learn(std::array{std::span<const Particle>(particles)}, requests);
  const std::size_t all = trainer.cache().size();
  REQUIRE(all > kept.size());
  // For each record, samples of directions that only the BSDF finds.
  std::vector<FractionSample> samples;
  for (std::size_t i = 0; i < 100 * all; ++i) samples.push_back({i % all, 1, 0.01f, 1, 1});
  trainer.learnFractions(samples);
  trainer.learn({}, {});  // a pass without particles
  const std::vector<IlluminationRecord> after = trainer.cache().records();
  for (std::size_t i = 0; i < all; ++i) {
    if (i < kept.size()) CHECK(after[i].bsdfFraction == kept[i].bsdfFraction);
    if (i >= kept.size()) CHECK(after[i].bsdfFraction > kInitialBsdfFraction);
  }
}
