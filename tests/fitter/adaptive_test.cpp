// Adaptive fitting of records and numbers of components.

#include <algorithm>
#include <array>
#include <span>

#include <tbb/global_control.h>
#include <catch2/catch.hpp>

#include "fitter/adaptive_fit.h"
#include "fitter/compile.h"
#include "tests/support/fitter_test_lobes.h"

using namespace lobe;

namespace {

/// The quality of the mixture that a look-up for wo returns.
Quality served(const Lobe& lobe, const DirectionGrid& grid, const FittedGrid& fit, const Vec3& wo) {
  std::array<Gaussian, kMaxCacheComponents> room;
  return gradeMixture(lobe, wo, fit.mixtureFor(grid, wo, room), 2048);
}

double meanComponents(const FittedGrid& fit) {
  return static_cast<double>(fit.components.size()) / static_cast<double>(fit.records.size());
}

}  // namespace

TEST_CASE("fitter: directions between the records reach the requested quality") {
  const FitSettings settings = defaultFitSettings();
  const double alpha = GENERATE(0.05, 0.3);
  const LobePtr lobe = conductorLobe(alpha, alpha);
  const DirectionGrid grid{GridKind::elevation, 64};
  const FittedGrid fit = fitAdaptively(*lobe, grid, settings);
  CHECK(fit.records.size() <= 32);
  CHECK(meanComponents(fit) <= 6);
  for (const double elevation : {0.0, 7.0, 21.0, 33.0, 48.0, 62.0, 75.0, 84.0, 88.0}) {
    CAPTURE(alpha, elevation);
    CHECK(served(*lobe, grid, fit, direction(elevation, 77)).coverage < 4 * settings.quality);
  }
}

TEST_CASE("fitter: a lower quality needs fewer components") {
  const LobePtr lobe = conductorLobe(0.2, 0.2);
  const DirectionGrid grid{GridKind::elevation, 64};
  FitSettings settings = defaultFitSettings();
  const FittedGrid fine = fitAdaptively(*lobe, grid, settings);
  settings.quality = 0.3f;
  const FittedGrid coarse = fitAdaptively(*lobe, grid, settings);
  CHECK(coarse.components.size() < fine.components.size() / 2);
}

TEST_CASE("fitter: as many components as allowed are used where the quality requires them") {
  const LobePtr lobe = conductorLobe(0.4, 0.4);
  FitSettings settings = defaultFitSettings();
  settings.quality = 1e-4f;
  settings.components = 5;
  CHECK(fitWithFewest(*lobe, direction(60), settings).mixture.size() == 5);
  settings.components = 16;
  CHECK(fitWithFewest(*lobe, direction(60), settings).mixture.size() > 8);
}

TEST_CASE("fitter: with default settings records are as good as weighted EM with eight components") {
  FitSettings settings = defaultFitSettings(), wem = settings;
  settings.reduction = wem.reduction = 0;
  wem.method = FitMethod::wem;
  std::size_t components = 0, records = 0;
  for (const auto& [distribution, alpha] :
       {std::pair("ggx", 0.05), std::pair("beckmann", 0.1), std::pair("beckmann", 0.3)}) {
    const LobePtr lobe = conductorLobe(alpha, alpha, distribution);
    for (const double elevation : {10.0, 40.0, 65.0, 80.0}) {
      CAPTURE(distribution, alpha, elevation);
      const FittedRecord fewest = fitWithFewest(*lobe, direction(elevation), settings);
      // More Gaussians are used only if they gain at least a quarter of the target.
      CHECK(fewest.largerVariance() <= 1.25f * fitLobe(*lobe, direction(elevation), wem).largerVariance());
      CHECK(fewest.largerVariance() <= 1.25f * settings.quality);
      components += fewest.mixture.size(), ++records;
    }
  }
  CHECK(components <= 5 * records);
}

TEST_CASE("fitter: an anisotropic lobe is fitted for a quarter of the directions and looked up for all") {
  const LobePtr lobe = conductorLobe(0.1, 0.3);
  const DirectionGrid grid{GridKind::fibonacci, 512};
  FitSettings settings = defaultFitSettings();
  settings.quality = 0.1f;
  const FittedGrid fit = fitAdaptively(*lobe, grid, settings);
  CHECK(fit.lookup.size() == 512);
  for (const CacheRecord& record : fit.records) {
    const Vec3 w = grid.direction(static_cast<int>(record.entry));
    CHECK((w.x() >= 0 && w.y() >= 0));
  }
  // The four mirrored copies of a direction have similar quality.
  for (const double elevation : {20.0, 55.0, 75.0}) {
    for (const double azimuth : {30.0, 150.0, 210.0, 330.0}) {
      CAPTURE(elevation, azimuth);
      CHECK(served(*lobe, grid, fit, direction(elevation, azimuth)).coverage < 0.25);
    }
  }
}

TEST_CASE("fitter: a nearly specular lobe gets records without components") {
  const LobePtr lobe = conductorLobe(0.001, 0.001);
  const FittedGrid fit = fitAdaptively(*lobe, {GridKind::elevation, 64}, defaultFitSettings());
  CHECK(fit.components.empty());
  CHECK_FALSE(fit.records.empty());
  for (const CacheRecord& record : fit.records) {
    CHECK(record.albedo > 0.3f);
    CHECK(record.albedo < 1.001f);
  }
  for (const std::uint32_t record : fit.lookup) CHECK(record < fit.records.size());
}

TEST_CASE("fitter: the adaptive fit does not depend on the number of threads") {
  const LobePtr lobe = conductorLobe(0.1, 0.1);
  std::vector<FittedGrid> fits;
  for (const std::size_t threads : {1u, 2u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    fits.push_back(fitAdaptively(*lobe, {GridKind::elevation, 16}, defaultFitSettings()));
  }
  const auto sameBytes = [](const auto& a, const auto& b) {
    return std::ranges::equal(std::as_bytes(std::span(a)), std::as_bytes(std::span(b)));
  };
  REQUIRE(fits[0].records.size() == fits[1].records.size());
  REQUIRE(fits[0].components.size() == fits[1].components.size());
  REQUIRE(fits[0].components.size() >= fits[0].records.size());
  CHECK(sameBytes(fits[0].records, fits[1].records));
  CHECK(sameBytes(fits[0].components, fits[1].components));
  CHECK(fits[0].lookup == fits[1].lookup);
}
