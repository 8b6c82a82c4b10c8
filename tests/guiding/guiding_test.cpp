// Illumination records, their look-up and training, and the density of the three sampling strategies.

#include <catch2/catch.hpp>

#include <cstring>
#include <limits>
#include <numbers>

#include "runtime/core/random.h"
#include "runtime/guiding/guided_density.h"
#include "runtime/guiding/illumination_trainer.h"
#include "tests/support/mixtures_chi2.h"

using namespace lobe;

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

Vec3 randomDirection(Rng& rng) {
  const Eigen::Vector2f u = rng.uniform2();
  const float z = 1 - 2 * u.x();
  const float r = std::sqrt(std::max(0.0f, 1 - z * z));
  return {r * std::cos(2 * kPi * u.y()), r * std::sin(2 * kPi * u.y()), z};
}

Vec3 randomPoint(Rng& rng) {
  return {rng.uniform(), rng.uniform(), rng.uniform()};
}

IlluminationRecord recordAt(const Vec3& x, const Vec3& n, float radius) {
  IlluminationRecord r{};
  r.position = x;
  r.normal = n;
  r.tangent = n.unitOrthogonal();
  r.radius = radius;
  r.background = 0.3f;
  r.samples = 1000;
  r.count = 2;
  r.components[0] = {0.6f, 0.3f, 0.2f, {0.01f, 0.004f, 0.02f}};
  r.components[1] = {0.4f, -0.5f, 0.1f, {0.03f, 0.0f, 0.005f}};
  return r;
}

/// A cache of one record, and that record in packed form.
struct OneRecord {
  explicit OneRecord(const IlluminationRecord& record)
      : cache({record}, 1), packed(*cache.find(record.position, record.normal)) {}
  IlluminationCache cache;
  const PackedRecord& packed;
};

/// IlluminationCache::find by exhaustive search.
const IlluminationRecord* bruteForce(std::span<const IlluminationRecord> records, const Vec3& x, const Vec3& n,
                                     float unit) {
  const IlluminationRecord* best = nullptr;
  float bestCost = 1e30f;
  for (const IlluminationRecord& r : records) {
    const float distance = (x - r.position).norm();
    if (distance > r.radius || n.dot(r.normal) < 0.97f) continue;
    const float cost = distance / unit + 2 * std::sqrt(std::max(0.0f, 1.001f - n.dot(r.normal)));
    if (cost < bestCost) {
      bestCost = cost;
      best = &r;
    }
  }
  return best;
}

/// Particles on the plane z = 0 from a small light around `towards` and, with probability `background`, from anywhere.
std::vector<Particle> planeParticles(int count, const Vec3& towards, float background, std::uint64_t seed) {
  std::vector<Particle> particles;
  Rng rng(seed);
  for (int i = 0; i < count; ++i) {
    Vec3 d;
    if (rng.uniform() < background) {
      const float r2 = rng.uniform();
      const float phi = 2 * kPi * rng.uniform();
      d = {std::sqrt(r2) * std::cos(phi), std::sqrt(r2) * std::sin(phi), std::sqrt(1 - r2)};
    } else {
      d = (towards + 0.05f * randomDirection(rng)).normalized();
    }
    particles.push_back({{rng.uniform(), rng.uniform(), 0}, Vec3::UnitZ(), d, 1.0f, 10.0f});
  }
  return particles;
}

std::vector<RecordRequest> planeRequests(int count) {
  std::vector<RecordRequest> requests;
  Rng rng(99);
  for (int i = 0; i < count; ++i) requests.push_back({{rng.uniform(), rng.uniform(), 0}, Vec3::UnitZ()});
  return requests;
}

}  // namespace

TEST_CASE("guiding: the look-up finds the best valid record") {
  Rng rng(7);
  const float unit = 0.1f;
  std::vector<IlluminationRecord> records;
  for (int i = 0; i < 2000; ++i)
    records.push_back(recordAt(randomPoint(rng), randomDirection(rng), unit * (0.1f + 0.9f * rng.uniform())));
  const IlluminationCache cache(records, unit);
  int found = 0;
  for (int i = 0; i < 5000; ++i) {
    Vec3 x = randomPoint(rng) * 1.2f - Vec3::Constant(0.1f), n = randomDirection(rng);
    if (i % 2 == 0) {  // most of the other normals find no record
      const IlluminationRecord& near = records[static_cast<std::size_t>(i) % records.size()];
      x = near.position + 0.3f * unit * randomDirection(rng);
      n = (near.normal + 0.3f * n).normalized();
    }
    const IlluminationRecord* expected = bruteForce(records, x, n, unit);
    const PackedRecord* record = cache.find(x, n);
    REQUIRE((record ? &records[record->index] : nullptr) == expected);
    found += expected != nullptr;
  }
  CHECK(found > 500);
  CHECK(IlluminationCache().find({0, 0, 0}, Vec3::UnitZ()) == nullptr);
}

TEST_CASE("guiding: records are packed without loss and up to four Gaussians take half the memory") {
  Rng rng(17);
  std::vector<IlluminationRecord> records;
  for (int count = 0; count <= kMaxLightComponents; ++count) {
    records.push_back(recordAt(randomPoint(rng), randomDirection(rng), 0.1f + rng.uniform()));
    records.back().count = count;
    records.back().irradiance = rng.uniform();
    records.back().bsdfFraction = rng.uniform();
    records.back().likelihoodGain = rng.uniform();
    for (Gaussian& g : records.back().components)
      g = {rng.uniform(), rng.uniform(), rng.uniform(), {0.1f + rng.uniform(), 0.1f * rng.uniform(), 0.1f}};
  }
  const IlluminationCache cache(records, 1);
  const std::vector<IlluminationRecord> back = cache.records();
  REQUIRE(back.size() == records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    const IlluminationRecord &a = records[i], &b = back[i];
    CHECK((a.position == b.position && a.normal == b.normal && a.tangent == b.tangent && a.radius == b.radius));
    CHECK(
        (a.background == b.background && a.irradiance == b.irradiance && a.samples == b.samples && a.count == b.count));
    CHECK((a.bsdfFraction == b.bsdfFraction && a.likelihoodGain == b.likelihoodGain));
    const auto bytes = static_cast<std::size_t>(a.count) * sizeof(Gaussian);
    CHECK(std::memcmp(a.components.data(), b.components.data(), bytes) == 0);
  }
  const IlluminationCache merged = reduced(cache, 1e6f);
  CHECK(merged.meanComponents() == Approx(8.0 / 9));  // all but the empty record keep one component
  CHECK(merged.bytes() < cache.bytes());
  CHECK(reduced(cache, 0).meanComponents() == cache.meanComponents());
  const auto bytesOf = [](IlluminationRecord r, int count) {
    r.count = count;
    return IlluminationCache({r}, 1).bytes();
  };
  CHECK(bytesOf(records[0], 8) - bytesOf(records[0], 4) == 160);  // 384 and 224 bytes
}

TEST_CASE("guiding: the look-up works far from the origin") {
  const IlluminationCache cache({recordAt({1e5f, -1e5f, 3e4f}, Vec3::UnitZ(), 50)}, 100);
  CHECK(cache.find({1e5f + 20, -1e5f, 3e4f}, Vec3::UnitZ()) != nullptr);
  CHECK(cache.find({1e5f + 60, -1e5f, 3e4f}, Vec3::UnitZ()) == nullptr);
  CHECK(cache.find({1e5f + 20, -1e5f, 3e4f}, -Vec3::UnitZ()) == nullptr);
}

void learn(IlluminationTrainer& trainer, std::span<const Particle> particles, std::span<const RecordRequest> requests) {
  trainer.learn(std::array{particles}, requests);
}

TEST_CASE("guiding: training learns the direction of the light and the background") {
  const Vec3 towards = Vec3(0.6f, 0.0f, 0.8f);
  IlluminationTrainer trainer({}, 10.0f);
  for (int pass = 0; pass < 6; ++pass)
    learn(trainer, planeParticles(20000, towards, 0.3f, 100 + pass), planeRequests(500));
  REQUIRE(trainer.cache().size() > 0);
  CHECK(trainer.undersampledFraction() == 0);
  const PackedRecord* found = trainer.cache().find({0.5f, 0.5f, 0}, Vec3::UnitZ());
  REQUIRE(found);
  const IlluminationRecord record = trainer.cache().unpacked(*found);
  CHECK(record.background == Approx(0.3f).margin(0.1f));
  Vec2 mean = Vec2::Zero();
  for (const Gaussian& g : record.gaussians()) mean += g.weight * g.mean();
  const Vec3 bitangent = record.normal.cross(record.tangent);
  const Vec2 expected = toDisc({towards.dot(record.tangent), towards.dot(bitangent), towards.z()});
  CHECK((mean - expected).norm() < 0.05f);
}

TEST_CASE("guiding: records that are fitted once more predict unseen particles better") {
  const Vec3 towards = Vec3(0.6f, 0.0f, 0.8f);
  const auto predicts = [&](int reservoir, bool refits) {
    TrainingOptions options;
    options.reservoir = reservoir;
    IlluminationTrainer trainer(options, 10.0f);
    for (int pass = 0; pass < 4; ++pass)
      learn(trainer, planeParticles(20000, towards, 0.3f, 100 + pass), planeRequests(500));
    const std::size_t records = trainer.cache().size();
    if (refits) trainer.refit();
    CHECK(trainer.cache().size() == records);
    const std::vector<Particle> unseen = planeParticles(20000, towards, 0.3f, 200);
    return trainer.learn(std::array{std::span<const Particle>(unseen)}, {}).value();
  };
  CHECK(predicts(500, true) > predicts(500, false) + 0.003);
  CHECK(predicts(0, true) == predicts(0, false));
}

TEST_CASE("guiding: the likelihood gain of a record compares the last pass with cosine-weighted sampling") {
  const Vec3 towards(0.6f, 0.0f, 0.8f), away(-0.8f, 0.0f, 0.6f);
  const std::vector<RecordRequest> one(1, RecordRequest{{0.5f, 0.5f, 0}, Vec3::UnitZ()});
  const auto gainAfter = [&](std::initializer_list<std::pair<Vec3, float>> passes) {
    IlluminationTrainer trainer({}, 10.0f);
    std::uint64_t seed = 100;
    for (const auto& [direction, background] : passes)
      learn(trainer, planeParticles(20000, direction, background, seed++), one);
    trainer.refit();
    REQUIRE(trainer.cache().size() == 1);
    return trainer.cache().records().front().likelihoodGain;
  };
  CHECK(gainAfter({{towards, 0.3f}}) == 0);  // a new record has predicted nothing yet
  CHECK(gainAfter({{towards, 0.3f}, {towards, 0.3f}}) > 1);
  CHECK(gainAfter({{towards, 0.3f}, {away, 0.0f}}) < -1);
  CHECK(gainAfter({{towards, 1}, {towards, 1}, {towards, 1}}) == Approx(0).margin(0.05));
}

TEST_CASE("guiding: training places records only near particles and no duplicates") {
  IlluminationTrainer trainer({}, 10.0f);
  learn(trainer, {}, planeRequests(10));
  CHECK(trainer.cache().size() == 0);
  const auto particles = planeParticles(5000, Vec3::UnitZ(), 0.5f, 3);
  const std::vector<RecordRequest> elsewhere{{{5, 5, 0}, Vec3::UnitZ()}, {{0.5f, 0.5f, 0}, -Vec3::UnitZ()}};
  learn(trainer, particles, elsewhere);
  CHECK(trainer.cache().size() == 0);
  const std::vector<RecordRequest> same(5, RecordRequest{{0.5f, 0.5f, 0}, Vec3::UnitZ()});
  learn(trainer, particles, same);
  CHECK(trainer.cache().size() == 1);
}

TEST_CASE("guiding: the irradiance of a record is the mean over all passes with photons") {
  IlluminationTrainer trainer({}, 10.0f);
  std::vector<Particle> photons = planeParticles(20000, Vec3::UnitZ(), 0.5f, 1);
  for (Particle& p : photons) p.flux = 1;
  learn(trainer, photons, std::vector<RecordRequest>(1, RecordRequest{{0.5f, 0.5f, 0}, Vec3::UnitZ()}));
  REQUIRE(trainer.cache().size() == 1);
  const auto irradiance = [&] { return trainer.cache().records().front().irradiance; };
  const float ofFirst = irradiance();
  CHECK(ofFirst == Approx(20000).epsilon(0.3));
  learn(trainer, planeParticles(20000, Vec3::UnitZ(), 0.5f, 2), {});  // of camera paths
  CHECK(irradiance() == ofFirst);
  for (Particle& p : photons) p.position.x() += 5;
  learn(trainer, photons, {});  // no photon reaches the record
  CHECK(irradiance() == Approx(0.5f * ofFirst));
}

TEST_CASE("guiding: the irradiance of few photons has the right mean") {
  // On average an eighth of the photons in the unit square is in the disc that is searched.
  constexpr float kReach = 0.2f;
  constexpr std::uint64_t kTrials = 4000;
  for (const int photons : {5, 25, 100}) {
    CAPTURE(photons);
    double sum = 0;
    for (std::uint64_t trial = 0; trial < kTrials; ++trial) {
      std::vector<Particle> particles = planeParticles(photons, Vec3::UnitZ(), 0.0f, trial);
      for (Particle& p : particles) p.flux = 1 / static_cast<float>(photons);
      const ParticleNeighbours neighbours(std::array{std::span<const Particle>(particles)}, 250, kReach);
      sum += neighbours.around({0.5f, 0.5f, 0}, Vec3::UnitZ(), Vec3::UnitX()).irradiance;
    }
    CHECK(sum / kTrials == Approx(1).epsilon(0.1));
  }
  // On a surface that is smaller than the search, the density is that of the surface.
  std::vector<Particle> particles = planeParticles(100, Vec3::UnitZ(), 0.0f, 1);
  for (Particle& p : particles) p.flux = 0.01f;
  const ParticleNeighbours neighbours(std::array{std::span<const Particle>(particles)}, 250, 10);
  CHECK(neighbours.around({0.5f, 0.5f, 0}, Vec3::UnitZ(), Vec3::UnitX()).irradiance == Approx(2 / kPi).epsilon(0.2));
}

TEST_CASE("guiding: particle sources of any scale are weighted by their effective number of samples") {
  const Vec3 left = Vec3(-0.6f, 0.0f, 0.8f), right = Vec3(0.6f, 0.0f, 0.8f);
  std::vector<Particle> dim = planeParticles(20000, left, 0.0f, 1), bright = planeParticles(20000, right, 0.0f, 2);
  for (Particle& p : bright) p.weight *= 1e6f;
  const Vec3 x(0.5f, 0.5f, 0);
  const ParticleNeighbours both(std::array{std::span<const Particle>(dim), std::span<const Particle>(bright)}, 250, 1);
  double sum = 0, asymmetry = 0;
  for (const WeightedPoint& p : both.around(x, Vec3::UnitZ(), Vec3::UnitX()).points) {
    sum += p.weight;
    asymmetry += p.weight * std::copysign(1.0f, p.y.x());
  }
  CHECK(sum == Approx(500).epsilon(0.3));
  CHECK(std::abs(asymmetry) < 0.2 * sum);

  // A particle that is much brighter than all others counts as one sample.
  dim.front().position = x;
  dim.front().weight = 1e6f;
  sum = 0;
  const ParticleNeighbours spoilt(std::array{std::span<const Particle>(dim)}, 250, 1);
  for (const WeightedPoint& p : spoilt.around(x, Vec3::UnitZ(), Vec3::UnitX()).points) sum += p.weight;
  CHECK(sum == Approx(1).epsilon(0.01));
}

TEST_CASE("guiding: distances that are not positive count as infinite") {
  std::vector<Particle> particles = planeParticles(100, Vec3::UnitZ(), 0.0f, 1);  // of distance 10
  for (std::size_t i = 0; i < 60; i += 3) {
    particles[i].distance = 0;
    particles[i + 1].distance = -1;
    particles[i + 2].distance = std::numeric_limits<float>::quiet_NaN();
  }
  const ParticleNeighbours neighbours(std::array{std::span<const Particle>(particles)}, 250, 10);
  CHECK(neighbours.around({0.5f, 0.5f, 0}, Vec3::UnitZ(), Vec3::UnitX()).distance == Approx(10 / 0.4f));
}

TEST_CASE("guiding: the search finds exactly the nearest particles") {
  Rng rng(5);
  std::vector<Particle> particles = planeParticles(3000, Vec3::UnitZ(), 0.5f, 9);
  for (int trial = 0; trial < 20; ++trial) {
    const Vec3 x(rng.uniform(), rng.uniform(), 0);
    std::vector<float> distances;
    for (const Particle& p : particles) distances.push_back((p.position - x).norm());
    std::ranges::sort(distances);
    const ParticleNeighbours nearest(std::array{std::span<const Particle>(particles)}, 40, 10);
    const Neighbourhood found = nearest.around(x, Vec3::UnitZ(), Vec3::UnitX());
    CHECK(found.points.size() == 40);
    CHECK(found.radius == Approx(distances[39]));
    const ParticleNeighbours close(std::array{std::span<const Particle>(particles)}, 40, 0.5f * distances[39]);
    CHECK(close.around(x, Vec3::UnitZ(), Vec3::UnitX()).radius < 0.5f * distances[39]);
  }
}

TEST_CASE("guiding: particles behind a thin wall are not counted as neighbours") {
  Rng rng(8);
  std::vector<Particle> particles;
  for (int i = 0; i < 20000; ++i) {
    const float side = i % 100 == 0 ? 1.0f : -1.0f;
    const Vec3 up = side * Vec3::UnitZ();
    particles.push_back({Vec3(rng.uniform(), rng.uniform(), 0), up, up, 1.0f, 1.0f});
  }
  const std::span<const Particle> source = particles;
  const ParticleNeighbours neighbours(std::span(&source, 1), 50, 1.0f);
  const Neighbourhood found = neighbours.around({0.5f, 0.5f, 0}, Vec3::UnitZ(), Vec3::UnitX());
  CHECK(found.points.size() == 50);
  CHECK(found.radius == Approx(std::sqrt(50 / (200 * M_PI))).epsilon(0.2));
}

TEST_CASE("guiding: errors name the invalid training option") {
  TrainingOptions options;
  options.components = 9;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("components"));
  options = {};
  options.unitFraction = 0;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("unitFraction"));
}

namespace {

Reflectance someReflectance() {
  Reflectance r;
  r.constant = 0.05f;
  r.backgroundMass = 0.4f;
  r.gaussians.add({0.3f, 0.25f, 0.15f, {0.02f, 0.0f, 0.01f}});
  r.gaussians.add({0.1f, 0.7f, 0.6f, {0.05f, 0.01f, 0.05f}});  // partly outside the disc
  return r;
}

/// Largest deviation of histogram counts over the disc from the density, in standard deviations.
double largestDeviation(const GuidedDensity& density, double mutant) {
  constexpr int bins = 12, samples = 400000, fine = 24;
  std::vector<double> counts(bins * bins), expected(bins * bins);
  Rng rng(11);
  for (int i = 0; i < samples; ++i) {
    float choice = rng.uniform();
    const Strategy strategy = density.choose(choice);
    if (strategy == Strategy::bsdf) continue;
    const auto wi = density.sample(strategy, choice, rng.uniform2());
    if (!wi) continue;
    const Vec2 y = toDisc(*wi);
    const int bx = std::min(bins - 1, static_cast<int>((y.x() + 1) / 2 * bins));
    const int by = std::min(bins - 1, static_cast<int>((y.y() + 1) / 2 * bins));
    ++counts[by * bins + bx];
  }
  const double step = 2.0 / (bins * fine);
  for (int j = 0; j < bins * fine; ++j)
    for (int i = 0; i < bins * fine; ++i) {
      const Vec2 y(static_cast<float>(-1 + (i + 0.5) * step), static_cast<float>(-1 + (j + 0.5) * step));
      if (insideDisc(y))
        expected[j / fine * bins + i / fine] += mutant * 2 * density.guidedPdf(fromDisc(y)) * step * step;
    }
  double worst = 0;
  for (int i = 0; i < bins * bins; ++i) {
    const double e = expected[i] * samples;
    if (e > 50) worst = std::max(worst, std::abs(counts[i] - e) / std::sqrt(e));
  }
  return worst;
}

}  // namespace

TEST_CASE("guiding: samples follow the reported density") {
  const Reflectance reflectance = someReflectance();
  const OneRecord record(recordAt(Vec3::Zero(), Vec3::UnitZ(), 1));
  for (const StrategyProbabilities& probabilities : {kProductProbabilities, kGuidedProbabilities}) {
    const GuidedDensity density(reflectance, record.packed, probabilities);
    CHECK(density.bsdfFraction() >= probabilities.bsdf);
    CHECK(largestDeviation(density, 1.0) < 5);
    CHECK(largestDeviation(density, 1.1) > 5);  // an error of a tenth in the density is detected
  }
}

namespace {

Reflectance oneLobe(const Gaussian& g) {
  Reflectance r;
  r.backgroundMass = 0.1f;
  r.gaussians.add(g);
  return r;
}

IlluminationRecord oneLight(const Gaussian& g) {
  IlluminationRecord r = recordAt(Vec3::Zero(), Vec3::UnitZ(), 1);
  r.count = 1;
  r.components[0] = g;
  return r;
}

}  // namespace

TEST_CASE("guiding: samples of extreme lobes follow the reported density") {
  struct Case {
    const char* name;
    Gaussian reflectance, light;
  };
  const auto round = [](float x, float y, float width) { return Gaussian{1, x, y, {width * width, 0, width * width}}; };
  const std::array cases{
      Case{"standard deviation 0.001", round(0.4f, 0.3f, 1e-3f), round(0.401f, 0.3f, 1e-3f)},
      Case{"standard deviation 0.001 under broad light", round(0.4f, 0.3f, 1e-3f), round(0.2f, 0, 0.3f)},
      Case{"almost too far apart", round(-0.4f, 0, 0.05f), round(0.4f, 0, 0.05f)},
      Case{"means outside the disc", round(1.1f, 0.1f, 0.2f), round(0.95f, 0.6f, 0.3f)},
      Case{"almost no mass inside the disc", round(1.5f, 0, 0.05f), round(1.55f, 0.1f, 0.05f)},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Reflectance reflectance = oneLobe(cases[i].reflectance);
    const OneRecord record(oneLight(cases[i].light));
    for (const StrategyProbabilities& probabilities :
         {kProductProbabilities, StrategyProbabilities{0.5f, 0.0f, 0.5f}}) {
      const GuidedDensity density(reflectance, record.packed, probabilities);
      const Chi2Result result = lobe::test::ofMixtures(density, i);
      INFO(cases[i].name << ": " << result.message);
      CHECK(result.passed(2 * static_cast<int>(cases.size())));
      CHECK_FALSE(lobe::test::ofMixtures(density, i, {}, 1.5f).passed(2 * static_cast<int>(cases.size())));
    }
  }
}

TEST_CASE("guiding: without a product its probability is added to the BSDF sampling fraction") {
  Reflectance far;
  far.backgroundMass = 0.4f;
  far.gaussians.add({1.0f, 50.0f, 50.0f, {1e-6f, 0, 1e-6f}});
  const OneRecord record(recordAt(Vec3::Zero(), Vec3::UnitZ(), 1));
  const GuidedDensity density(far, record.packed, kProductProbabilities);
  CHECK(density.bsdfFraction() == Approx(kProductProbabilities.bsdf + kProductProbabilities.product));
  CHECK(std::isfinite(density.guidedPdf({0.6f, 0, 0.8f})));
  CHECK(density.guidedPdf({0.6f, 0, -0.8f}) == 0);
}

TEST_CASE("guiding: at a diffuse point the product is the illumination mixture") {
  Reflectance diffuse;
  diffuse.constant = 0.5f / kPi;
  diffuse.backgroundMass = diffuse.constant;
  const OneRecord record(recordAt(Vec3::Zero(), Vec3::UnitZ(), 1));
  const GuidedDensity density(diffuse, record.packed, {0.9f, 0.1f, 0.0f});
  // The background, a fraction 0.3 of the product, is sampled by the BSDF: 0.1 + 0.9·0.3.
  CHECK(density.bsdfFraction() == Approx(0.37f));
  const Vec3 wi = Vec3(0.3f, 0.1f, 0.9f).normalized();
  CHECK(density.guidedPdf(wi) ==
        Approx(0.9f * 0.7f * mixturePdf(recordAt(Vec3::Zero(), Vec3::UnitZ(), 1).gaussians(), toDisc(wi)) / 2));
}
