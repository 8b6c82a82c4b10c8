// What lobedump shows: grades, plots and differences.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include <nlohmann/json.hpp>

#include "fitter/disc_mass.h"
#include "fitter/lobe_fit.h"
#include "fitter/report.h"
#include "schema/atomic_file.h"
#include "tests/fitter_test_lobes.h"
#include "tests/tool_run.h"

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

namespace {

/// f/p in units of ∫ f dω, the defensive density written out once more.
double ratioAt(const Lobe& lobe, const Vec3& wo, const FittedRecord& fit, const Vec3& wi) {
  const double guided = mixturePdf(fit.mixture, toDisc(wi)) * wi.z() / fit.record.cosineMass / 2;
  const double p = 0.1 * lobe.pdf(wo, wi) + 0.9 * guided;
  return p > 0 ? lobe.eval(wo, wi) * wi.z() / fit.record.albedo / p : 0;
}

}  // namespace

TEST_CASE("fitter: worst f/p is the largest ratio over the disc, and is met where the grade says") {
  for (const double elevation : {10.0, 60.0, 85.0}) {
    const LobePtr lobe = roughConductor(0.3, 0.3)->lobes().front();
    const auto theta = static_cast<float>(elevation * 3.14159265 / 180);
    const Vec3 wo(std::sin(theta), 0, std::cos(theta));
    FitSettings settings;
    settings.components = 2;  // poor, so that there is something to find
    const FittedRecord fit = fitLobe(*lobe, wo, settings);
    double largest = 0;
    for (int i = 0; i < 500; ++i) {
      for (int j = 0; j < 500; ++j) {
        const Vec2 y(static_cast<float>(i + 0.5) / 250 - 1, static_cast<float>(j + 0.5) / 250 - 1);
        if (insideDisc(y)) largest = std::max(largest, ratioAt(*lobe, wo, fit, fromDisc(y)));
      }
    }
    const Quality quality = gradeMixture(*lobe, wo, fit.mixture, settings.samples);
    CAPTURE(elevation, largest);
    CHECK(fit.record.worstRatio == static_cast<float>(quality.worst));
    CHECK(quality.worst > 1 + std::max(quality.nev, quality.coverage) - 0.02);
    CHECK(quality.worst <= 1.02 * largest);
    CHECK(quality.worst > 0.8 * largest);
    CHECK(ratioAt(*lobe, wo, fit, quality.worstAt) == Approx(quality.worst).epsilon(0.02));
  }
}
