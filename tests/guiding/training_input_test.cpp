// The structures that hold the input of training: merged sample storages, trees of particles, cubes of requests,
// reservoirs of points.

#include <algorithm>
#include <array>
#include <set>

#include <tbb/task_group.h>
#include <catch2/catch.hpp>

#include "runtime/core/random.h"
#include "runtime/guiding/particle_tree.h"
#include "runtime/guiding/point_reservoir.h"
#include "runtime/guiding/request_cubes.h"
#include "runtime/guiding/sample_storage_data.h"

namespace {

using namespace lobe;

/// A storage with paths of 0 to 2 photons and requests; numbers of paths and samples depend on the seed.
SampleStorage randomStorage(std::uint64_t seed) {
  Rng rng(seed);
  SampleStorage storage;
  for (std::uint64_t path = 0; path < 5 * seed; ++path) {
    storage.beginPath(100 * seed + path);
    for (int i = 0; static_cast<float>(i) < 3 * rng.uniform() - 1; ++i)
      storage.addPhoton({rng.uniform(), 0, 0}, {0, 0, 1}, {0, 0, 1}, rng.uniform(), 1, 1);
    for (int i = 0; static_cast<float>(i) < 3 * rng.uniform() - 1; ++i)
      storage.requestRecord({rng.uniform(), 0, 0}, {0, 0, 1});
  }
  return storage;
}

/// Path index and coordinate of every photon, then of every request.
std::vector<std::pair<std::uint64_t, float>> contentOf(const SampleStorageData& data) {
  std::vector<std::pair<std::uint64_t, float>> content;
  for (std::size_t i = 0; i < data.paths.size(); ++i) {
    const SampleStorageData::Path next = i + 1 < data.paths.size() ? data.paths[i + 1] : data.end();
    for (std::size_t k = data.paths[i].photons; k < next.photons; ++k)
      content.emplace_back(data.paths[i].index, data.photons[k].position.x());
    for (std::size_t k = data.paths[i].requests; k < next.requests; ++k)
      content.emplace_back(data.paths[i].index, data.requests[k].position.x());
  }
  return content;
}

Vec3 randomPoint(Rng& rng) {
  const Vec2 xy = rng.uniform2();
  return {4 * xy.x() - 2, xy.y() - 0.5f, 3 * rng.uniform()};
}

}  // namespace

TEST_CASE("guiding: sample storages can be merged one at a time or all at once, in any order") {
  std::vector<SampleStorage> parts;
  std::vector<std::pair<std::uint64_t, float>> expected;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    parts.push_back(randomStorage(seed));
    std::ranges::copy(contentOf(dataOf(parts.back())), std::back_inserter(expected));
  }
  REQUIRE(expected.size() > 50);
  SECTION("one at a time") {
    SampleStorage all;
    for (SampleStorage& part : parts) all.merge(std::move(part));
    CHECK(contentOf(dataOf(all)) == expected);
  }
  SECTION("all at once") {
    SampleStorage all = randomStorage(9);
    std::vector<std::pair<std::uint64_t, float>> both = contentOf(dataOf(all));
    std::ranges::copy(expected, std::back_inserter(both));
    all.merge(parts);
    CHECK(contentOf(dataOf(all)) == both);
    CHECK(std::ranges::all_of(parts, [](const SampleStorage& s) { return s.particles() == 0; }));
  }
  SECTION("into one of them") {
    parts.front() = randomStorage(9);
    std::vector<std::pair<std::uint64_t, float>> both = contentOf(dataOf(parts.front()));
    REQUIRE(!both.empty());
    std::ranges::copy(expected, std::back_inserter(both));
    parts.front().merge(parts);
    CHECK(contentOf(dataOf(parts.front())) == both);
    CHECK(std::all_of(parts.begin() + 1, parts.end(), [](const SampleStorage& s) { return s.particles() == 0; }));
    parts.front().merge(std::move(parts.front()));
    CHECK(contentOf(dataOf(parts.front())) == both);
  }
  SECTION("in another order") {
    std::ranges::reverse(parts);
    SampleStorage all;
    all.merge(parts);
    CHECK(!dataOf(all).isInOrder());
    CHECK(contentOf(dataOf(all).inOrder()) == expected);
  }
}

TEST_CASE("guiding: a merge that is cancelled leaves the storages empty and usable") {
  SampleStorage all = randomStorage(9);
  std::vector<SampleStorage> parts;
  for (std::uint64_t seed = 0; seed < 6; ++seed) parts.push_back(randomStorage(seed));
  tbb::task_group group;
  bool thrown = false;
  group.run([&] {
    group.cancel();
    try {
      all.merge(parts);
    } catch (const std::runtime_error&) {
      thrown = true;
    }
  });
  group.wait();
  REQUIRE(thrown);
  CHECK((dataOf(all).paths.empty() && all.particles() == 0));
  CHECK(std::ranges::all_of(parts, [](const SampleStorage& s) { return s.particles() == 0; }));
  all.merge(randomStorage(9));
  CHECK(contentOf(dataOf(all)) == contentOf(dataOf(randomStorage(9))));
}

TEST_CASE("guiding: a tree of particles finds every particle within the distance") {
  Rng rng(11);
  for (const int count : {0, 1, 16, 17, 1000, 5000}) {
    std::vector<Particle> particles;
    for (int i = 0; i < count; ++i) {
      Vec3 x = randomPoint(rng);
      if (i % 3 == 0) x.z() = 1;  // many equal coordinates
      particles.push_back({x, Vec3::UnitZ(), Vec3::UnitZ(), static_cast<float>(i), 1});
    }
    const ParticleTree tree(particles);
    struct Within {
      float limit2;
      std::vector<std::uint32_t> indices;
      float reach2() const { return limit2; }
      void add(float, std::uint32_t index) { indices.push_back(index); }
    };
    for (int trial = 0; trial < 50; ++trial) {
      const Vec3 x = randomPoint(rng);
      Within within{0.1f * rng.uniform(), {}};
      tree.search(x, within);
      std::set<float> found, expected;
      for (const std::uint32_t i : within.indices) found.insert(tree.particles()[i].weight);
      for (const Particle& p : particles)
        if ((p.position - x).squaredNorm() < within.limit2) expected.insert(p.weight);
      CHECK(found == expected);
      CHECK(found.size() == within.indices.size());
    }
  }
}

TEST_CASE("guiding: requests in different cubes of one parity are far apart") {
  Rng rng(13);
  std::vector<RecordRequest> requests;
  for (int i = 0; i < 3000; ++i) requests.push_back({randomPoint(rng), Vec3::UnitZ()});
  const float edge = 0.3f;
  const RequestCubes cubes(requests, edge, [](const RecordRequest& r) { return r.position.x() < 1; });

  std::vector<std::size_t> cubeOf(requests.size(), cubes.size());
  std::vector<int> parityOf(cubes.size(), -1);
  for (int parity = 0; parity < RequestCubes::kParities; ++parity)
    for (const std::size_t cube : cubes.ofParity(parity)) {
      CHECK(parityOf[cube] == -1);
      parityOf[cube] = parity;
      CHECK(std::ranges::is_sorted(cubes.requests(cube)));
      for (const std::uint32_t i : cubes.requests(cube)) cubeOf[i] = cube;
    }
  CHECK(std::ranges::none_of(parityOf, [](int parity) { return parity < 0; }));
  std::vector<std::set<std::size_t>> around;
  for (std::size_t cube = 0; cube < cubes.size(); ++cube) {
    const std::vector<std::size_t> near = cubes.around(cube);
    around.emplace_back(near.begin(), near.end());
  }
  int inOneCube = 0, apart = 0, touching = 0;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    CHECK((cubeOf[i] < cubes.size()) == (requests[i].position.x() < 1));
    if (cubeOf[i] == cubes.size()) continue;
    for (std::size_t k = 0; k < i; ++k) {
      if (cubeOf[k] == cubes.size()) continue;
      const bool close = (requests[i].position - requests[k].position).norm() < edge;
      const bool same = cubeOf[i] == cubeOf[k];
      inOneCube += same;
      apart += close && !same && parityOf[cubeOf[i]] == parityOf[cubeOf[k]];
      touching += close && !around[cubeOf[i]].contains(cubeOf[k]);
    }
  }
  CHECK(inOneCube > 1000);
  CHECK(apart == 0);
  CHECK(touching == 0);
}

TEST_CASE("guiding: a reservoir keeps all points up to its capacity") {
  PointReservoir reservoir(10, 1, 2, 3);
  const std::vector<WeightedPoint> points(7, WeightedPoint{{0.5f, 0}, 0.25f});
  reservoir.add(points);
  reservoir.add(std::vector<WeightedPoint>{{{0, 0}, 0}, {{0, 0}, std::numeric_limits<float>::infinity()}});
  CHECK(reservoir.points().size() == 7);
  CHECK(std::ranges::all_of(reservoir.points(), [](const WeightedPoint& p) { return p.weight == 0.25f; }));
  for (int pass = 0; pass < 5; ++pass) reservoir.add(points);
  CHECK(reservoir.points().size() == 10);
  PointReservoir none(0, 1, 2, 3);
  none.add(points);
  CHECK(none.points().empty());
}

TEST_CASE("guiding: a reservoir estimates sums over all points without bias") {
  // Weights over four magnitudes, largest in the first of four passes, and a sum over half of the points.
  std::vector<WeightedPoint> points;
  Rng rng(17);
  double expected = 0;
  for (int i = 0; i < 800; ++i) {
    const float weight = std::pow(10.0f, -4 * rng.uniform()) * (i < 200 ? 5.0f : 1.0f);
    points.push_back({{i % 2 == 0 ? 0.5f : -0.5f, 0}, weight});
    expected += i % 2 == 0 ? weight : 0;
  }
  double mean = 0, square = 0;
  constexpr int kRepeats = 4000;
  for (std::uint64_t seed = 0; seed < kRepeats; ++seed) {
    PointReservoir reservoir(60, seed, 5, 6);
    for (std::size_t pass = 0; pass < 4; ++pass) reservoir.add(std::span(points).subspan(200 * pass, 200));
    double sum = 0;
    for (const WeightedPoint& p : reservoir.points()) sum += p.y.x() > 0 ? p.weight : 0.0f;
    mean += sum / kRepeats;
    square += sum * sum / kRepeats;
  }
  const double standardError = std::sqrt((square - mean * mean) / kRepeats);
  INFO("mean " << mean << ", expected " << expected << ", standard error " << standardError);
  CHECK(std::abs(mean - expected) < 4 * standardError);
  CHECK(standardError < 0.005 * expected);
}
