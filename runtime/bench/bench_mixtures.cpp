// lobebench-mixtures: what the parts of the mixture representation do, as in Figures 4 to 6 of Herholz et al. 2016:
// fits along the plane of incidence, look-ups with and without the alignment to the queried direction, and the
// reduction of mixtures by merging.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "fitter/compile.h"
#include "fitter/grade.h"
#include "materials/registry.h"
#include "runtime/core/random.h"
#include "runtime/core/statistics.h"
#include "runtime/mixture/disc.h"
#include "runtime/mixture/lookup.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/tool.h"

namespace {

using namespace lobe;
using Json = nlohmann::ordered_json;

constexpr std::uint32_t kGradeSamples = 8192;

struct Surface {
  const char* name;
  const char* model;
  std::vector<std::pair<const char*, double>> parameters;
};

const std::array<Surface, 5> kSurfaces{{{"GGX 0.1", "roughconductor", {{"alpha", 0.1}}},
                                        {"GGX 0.3", "roughconductor", {{"alpha", 0.3}}},
                                        {"plastic 0.1", "roughplastic", {{"alpha", 0.1}}},
                                        {"GGX 0.05×0.2", "roughconductor", {{"alpha_u", 0.05}, {"alpha_v", 0.2}}},
                                        {"GGX 0.1×0.4", "roughconductor", {{"alpha_u", 0.1}, {"alpha_v", 0.4}}}}};

LobePtr lobeOf(const Surface& surface) {
  Parameters parameters;
  parameters.set("distribution", "ggx");
  for (const auto& [name, value] : surface.parameters) parameters.set(name, value);
  return makeBsdf(surface.model, parameters)->lobes().front();
}

Vec3 direction(double degrees, double azimuth) {
  const double theta = degrees * std::numbers::pi / 180;
  return {static_cast<float>(std::sin(theta) * std::cos(azimuth)),
          static_cast<float>(std::sin(theta) * std::sin(azimuth)), static_cast<float>(std::cos(theta))};
}

/// A whole grid, fitted by weighted EM with eight components.
struct Fitted {
  CompileJob job;
  FittedGrid fit;
  Fitted(const LobePtr& lobe, int directions)
      : job(plan(lobe, directions)), fit(fitGrid(*lobe, job.grid, job.info.settings)) {}

  static CompileJob plan(const LobePtr& lobe, int directions) {
    CompileOptions options;
    options.settings.method = FitMethod::wem;
    options.settings.reduction = 0;
    options.elevations = options.directions = directions;
    return planCompile({{lobe, {}}}, options).front();
  }

  /// The direction that the record for wo was fitted for, at the azimuth of wo in a grid of elevations. A look-up for
  /// it returns the record as it was fitted.
  Vec3 recordDirection(const Vec3& wo) const {
    const Vec3 reference = job.grid.direction(job.grid.nearest(fit.quarter ? Mirror::intoQuadrant(wo)(wo) : wo));
    if (job.grid.kind == GridKind::fibonacci) return fit.quarter ? Mirror::intoQuadrant(wo)(reference) : reference;
    const Vec2 azimuth = wo.head<2>().normalized();
    return {reference.x() * azimuth.x(), reference.x() * azimuth.y(), reference.z()};
  }
};

// ---- Figure 4: the target and its fit along the plane of incidence.

Json slices() {
  constexpr int kPoints = 201;
  Json rows = Json::array();
  for (const Surface& surface : kSurfaces) {
    const LobePtr lobe = lobeOf(surface);
    FitSettings settings = defaultFitSettings();
    for (const double elevation : {15.0, 45.0, 75.0}) {
      const Vec3 wo = direction(elevation, 0);
      settings.method = FitMethod::wem;
      const FittedRecord fitted = fitLobe(*lobe, wo, settings);
      Json row{{"surface", surface.name}, {"elevation", elevation}};
      for (int i = 0; i < kPoints; ++i) {
        const Vec2 y(static_cast<float>(-0.999 + 1.998 * i / (kPoints - 1)), 0);
        row["y"].push_back(y.x());
        // Both are densities over the disc: the fit is normalised within it.
        row["target"].push_back(2 * lobe->eval(wo, fromDisc(y)) / fitted.record.integral);
        row["fit"].push_back(mixturePdf(fitted.mixture, y) / (1 - fitted.record.outside));
      }
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

// ---- Figure 5: look-ups with and without the alignment.

Json alignment(const std::vector<int>& counts) {
  constexpr int kQueries = 48;
  Json rows = Json::array();
  for (const Surface& surface : kSurfaces) {
    const LobePtr lobe = lobeOf(surface);
    for (const int count : counts) {
      const Fitted fitted(lobe, count);
      std::array<std::vector<double>, 2> nevs;
      for (int i = 0; i < kQueries; ++i) {
        const Vec3 wo = direction(85 * (i + 0.5) / kQueries, 2.4 * i + 0.3);
        std::array<Gaussian, kMaxCacheComponents> room;
        const std::array<Vec3, 2> queries{wo, fitted.recordDirection(wo)};
        for (std::size_t k = 0; k < queries.size(); ++k)
          nevs[k].push_back(
              gradeMixture(*lobe, wo, fitted.fit.mixtureFor(fitted.job.grid, queries[k], room), kGradeSamples)
                  .largerVariance());
      }
      rows.push_back({{"surface", surface.name},
                      {"records", count},
                      {"aligned", {{"median", quantile(nevs[0], 0.5)}, {"p90", quantile(nevs[0], 0.9)}}},
                      {"not_aligned", {{"median", quantile(nevs[1], 0.5)}, {"p90", quantile(nevs[1], 0.9)}}}});
    }
  }
  return rows;
}

// ---- Figure 6: merging of components.

Mixture syntheticMixture(Rng& rng) {
  constexpr int kComponents = 16;
  Mixture mixture;
  for (int k = 0; k < kComponents; ++k) {
    const Vec2 mean = fromDisc(0.9f * (2 * rng.uniform2() - Vec2::Ones())).head<2>() * 0.7f;
    const float broad = 0.02f + 0.15f * rng.uniform(), narrow = broad * (0.3f + 0.7f * rng.uniform());
    const float angle = 3.14159f * rng.uniform();
    Gaussian g;
    g.weight = 1.0f / kComponents;
    g.meanX = mean.x(), g.meanY = mean.y();
    g.cov.xx = broad * broad, g.cov.yy = narrow * narrow, g.cov.xy = 0;
    mixture.push_back(rotated(g, {std::cos(angle), std::sin(angle)}));
  }
  return mixture;
}

/// The relative variance of samples of `merged` as an estimator of the integral of `whole`.
double relativeVariance(const Mixture& whole, const Mixture& merged, Rng& rng) {
  constexpr int kSamples = 20000;
  double second = 0;
  for (int i = 0; i < kSamples; ++i) {
    const Vec2 y = sampleMixture(merged, rng.uniform(), rng.uniform2());
    const double ratio = mixturePdf(whole, y) / mixturePdf(merged, y);
    second += ratio * ratio / kSamples;
  }
  return second - 1;
}

Json reduction() {
  constexpr int kMixtures = 30;
  Json rows = Json::array();
  for (const float threshold : {0.0f, 0.02f, 0.05f, 0.1f, 0.2f, 0.4f, 0.8f, 1.6f, 3.2f}) {
    std::vector<double> components, costs, nevs;
    for (int m = 0; m < kMixtures; ++m) {
      Rng rng(17, static_cast<std::uint64_t>(m));
      const Mixture whole = syntheticMixture(rng);
      Mixture merged = whole;
      costs.push_back(lobe::reduce(merged, threshold));
      components.push_back(static_cast<double>(merged.size()));
      nevs.push_back(relativeVariance(whole, merged, rng));
    }
    rows.push_back({{"threshold", threshold},
                    {"components", median(components)},
                    {"cost", median(costs)},
                    {"nev", median(nevs)},
                    {"nev_p90", quantile(nevs, 0.9)}});
  }
  return rows;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<int> counts{16, 32, 64};
  return lobe::runTool(
      "lobebench-mixtures",
      "Measures fits along the plane of incidence, the alignment of look-ups, and the reduction of mixtures; prints "
      "JSON.",
      argc, argv,
      [&](CLI::App& app) {
        app.add_option("--records", counts, "Numbers of records of the look-ups")->capture_default_str();
      },
      [&] {
        fmt::print("{}\n",
                   jsonText({{"slices", slices()}, {"alignment", alignment(counts)}, {"reduction", reduction()}}, 1));
      });
}
