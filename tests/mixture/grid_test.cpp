// Direction grids, compared with exhaustive search.
#include <catch2/catch.hpp>

#include "runtime/core/random.h"
#include "runtime/mixture/grid.h"

using namespace lobe;

namespace {

// A third of the directions is close to the pole, another third close to the horizon.
Vec3 randomDirection(Rng& rng, int i) {
  const float u = rng.uniform(), phi = 6.2831853f * rng.uniform();
  const float z = i % 3 == 0 ? u : i % 3 == 1 ? 1 - 0.01f * u : 0.02f * u;
  const float s = std::sqrt(1 - z * z);
  return {s * std::cos(phi), s * std::sin(phi), z};
}

double elevationOf(const Vec3& w) {
  return std::atan2(std::hypot(w.x(), w.y()), w.z());
}

double gap(const DirectionGrid& grid, const Vec3& w, const Vec3& entry) {
  return grid.kind == GridKind::elevation ? std::abs(elevationOf(entry) - elevationOf(w)) : (entry - w).norm();
}

// The largest difference between the distance to the grid's answer and to the nearest entry.
double worstExcess(const DirectionGrid& grid, int queries) {
  std::vector<Vec3> entries;
  entries.reserve(static_cast<std::size_t>(grid.count));
  for (int i = 0; i < grid.count; ++i) entries.push_back(grid.direction(i));
  Rng rng(31);
  double worst = 0;
  for (int q = 0; q < queries; ++q) {
    const Vec3 w = randomDirection(rng, q);
    double best = 1e9;
    for (const Vec3& e : entries) best = std::min(best, gap(grid, w, e));
    const int found = grid.nearest(w);
    if (found < 0 || found >= grid.count) return 1e9;
    worst = std::max(worst, gap(grid, w, entries[static_cast<std::size_t>(found)]) - best);
  }
  return worst;
}

}  // namespace

TEST_CASE("mixture: grids find the nearest direction") {
  for (const int count : {1, 2, 3, 16, 17, 64, 100, 512, 1024, 4096}) {
    for (const GridKind kind : {GridKind::elevation, GridKind::fibonacci}) {
      INFO(count << " directions, kind " << static_cast<int>(kind));
      CHECK(worstExcess({kind, count}, count > 2000 ? 3000 : 6000) < 2e-7);
    }
  }
}

TEST_CASE("mixture: every grid direction is a unit vector above the horizon and its own nearest entry") {
  for (const int count : {1, 2, 16, 64, 1024, 4096}) {
    for (const GridKind kind : {GridKind::elevation, GridKind::fibonacci}) {
      const DirectionGrid grid{kind, count};
      int bad = 0;
      for (int i = 0; i < count; ++i) {
        const Vec3 w = grid.direction(i);
        bad += !(w.z() > 0) || std::abs(w.norm() - 1) > 1e-6f || grid.nearest(w) != i;
      }
      CHECK(bad == 0);
    }
  }
}

TEST_CASE("mixture: grid look-up works at the pole and at the horizon") {
  for (const int count : {1, 2, 64, 4096}) {
    const DirectionGrid elevations{GridKind::elevation, count}, points{GridKind::fibonacci, count};
    CHECK(elevations.nearest({0, 0, 1}) == 0);
    CHECK(elevations.nearest({0, 1, 0}) == count - 1);
    for (const Vec3& w : {Vec3(0, 0, 1), Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, -1, 0)}) {
      CHECK(points.nearest(w) >= 0);
      CHECK(points.nearest(w) < count);
    }
  }
}

TEST_CASE("mixture: elevations are denser towards grazing") {
  const DirectionGrid grid{GridKind::elevation, 16};
  for (int i = 2; i < 16; ++i) {
    const double last = elevationOf(grid.direction(i)) - elevationOf(grid.direction(i - 1));
    const double before = elevationOf(grid.direction(i - 1)) - elevationOf(grid.direction(i - 2));
    CHECK(last < before);
    CHECK(grid.direction(i).y() == 0);
  }
}
