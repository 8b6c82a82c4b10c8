// lobebench-caches: compares fit methods on whole caches by time, size, and the relative variance (NEV) of look-ups
// between records.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "fitter/compile.h"
#include "materials/lobes/roughness_levels.h"
#include "materials/registry.h"
#include "runtime/core/statistics.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/tool.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_lobes.h"

namespace {

using namespace lobe;

constexpr std::uint32_t kGradeSamples = 8192;
constexpr int kDirections = 24;
constexpr double kLastElevation = 88;

struct Options {
  std::string scene;
  bool levels = false;
  std::vector<std::string> ways;
  ReadOptions read;
};

/// "wem", "ceres", "eq8", or "auto:QUALITY".
CompileOptions optionsOf(const std::string& way) {
  CompileOptions options;
  options.settings.reduction = 0;
  const std::optional<FitMethod> method = fitMethodOf(way.substr(0, way.find(':')));
  if (!method) throw UsageError(fmt::format("--way: unknown method '{}'", way));
  options.settings.method = *method;
  if (const std::size_t colon = way.find(':'); colon != std::string::npos)
    options.settings.quality = std::stof(way.substr(colon + 1));
  options.validate();
  return options;
}

/// Uniform in elevation, at varying azimuths; none coincides with a direction of a grid.
Vec3 queryDirection(int i) {
  const double theta = kLastElevation * (i + 0.5) / kDirections * std::numbers::pi / 180, phi = 2.4 * i + 0.3;
  return {static_cast<float>(std::sin(theta) * std::cos(phi)), static_cast<float>(std::sin(theta) * std::sin(phi)),
          static_cast<float>(std::cos(theta))};
}

/// The relative variance of a look-up for wo; nullopt without components, where only the lobe's own sampler is used.
std::optional<double> servedNev(const Lobe& lobe, const DirectionGrid& grid, const FittedGrid& fit, const Vec3& wo) {
  std::array<Gaussian, kMaxCacheComponents> room;
  const std::span<const Gaussian> mixture = fit.mixtureFor(grid, wo, room);
  if (mixture.empty()) return std::nullopt;
  return gradeMixture(lobe, wo, mixture, kGradeSamples).largerVariance();
}

/// Relative variances of fits for the directions themselves, by the most accurate method and with the maximum number of
/// components.
std::vector<double> ownNevs(const Lobe& lobe, const CompileOptions& options) {
  FitSettings settings = options.settings;
  settings.method = FitMethod::ceres;
  std::vector<double> nevs;
  for (int i = 0; i < kDirections; ++i) {
    const Vec3 wo = queryDirection(i);
    nevs.push_back(gradeMixture(lobe, wo, fitLobe(lobe, wo, settings).mixture, kGradeSamples).largerVariance());
  }
  return nevs;
}

void addQualities(const std::vector<double>& nevs, const std::vector<double>& ratios, nlohmann::ordered_json& row) {
  row["nev_median"] = quantile(nevs, 0.5);
  row["nev_worst"] = std::ranges::max(nevs);
  row["ratio_median"] = quantile(ratios, 0.5);
  row["ratio_p90"] = quantile(ratios, 0.9);
}

nlohmann::ordered_json measure(const LobeUse& use, const std::string& way, const std::vector<double>& own) {
  const CompileJob job = planCompile({use}, optionsOf(way)).front();
  const auto start = std::chrono::steady_clock::now();
  const FittedGrid fit = fitGrid(*use.lobe, job.grid, job.info.settings);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::vector<double> nevs, ratios;
  for (int i = 0; i < kDirections; ++i) {
    const std::optional<double> nev = servedNev(*use.lobe, job.grid, fit, queryDirection(i));
    if (!nev) continue;
    nevs.push_back(*nev);
    ratios.push_back((1 + *nev) / (1 + own[static_cast<std::size_t>(i)]));
  }
  nlohmann::ordered_json row{{"lobe", use.materials.front()}, {"way", way}, {"seconds", seconds}};
  row["records"] = fit.records.size();
  row["components"] = static_cast<double>(fit.components.size()) / static_cast<double>(fit.records.size());
  row["bytes"] = encodeLobeCache(job.info, fit.records, fit.components, fit.lookup).size();
  if (nevs.empty()) return row;
  addQualities(nevs, ratios, row);
  return row;
}

// ---- Textured roughness: a look-up for an alpha halfway between two levels blends the mixtures of both.

struct FittedLevel {
  double alpha;
  DirectionGrid grid;
  FittedGrid fit;
};

LobePtr conductorLobe(const char* distribution, double alpha) {
  Parameters parameters;
  parameters.set("distribution", distribution);
  parameters.set("alpha", alpha);
  return makeBsdf("roughconductor", parameters)->lobes().front();
}

/// Both levels have the same interpolation weight, so each is weighted by its integral.
Mixture betweenLevels(const FittedLevel& a, const FittedLevel& b, const Vec3& wo) {
  Mixture mixture;
  double sum = 0;
  for (const FittedLevel* level : {&a, &b}) {
    std::array<Gaussian, kMaxCacheComponents> room;
    const std::uint32_t found = level->fit.lookup[static_cast<std::size_t>(level->grid.nearest(wo))];
    const CacheRecord& record = level->fit.records[found];
    for (Gaussian g : level->fit.mixtureFor(level->grid, wo, room)) {
      g.weight *= record.integral / std::max(1 - record.outside, 0.1f);
      sum += g.weight;
      mixture.push_back(g);
    }
  }
  for (Gaussian& g : mixture) g.weight = static_cast<float>(g.weight / sum);
  return mixture;
}

nlohmann::ordered_json measureBetween(const char* distribution, const std::string& way, const FittedLevel& a,
                                      const FittedLevel& b) {
  const double alpha = std::sqrt(a.alpha * b.alpha);
  const LobePtr lobe = conductorLobe(distribution, alpha);
  const std::vector<double> own = ownNevs(*lobe, optionsOf("ceres"));
  std::vector<double> nevs, ratios;
  for (int i = 0; i < kDirections; ++i) {
    const Vec3 wo = queryDirection(i);
    nevs.push_back(gradeMixture(*lobe, wo, betweenLevels(a, b, wo), kGradeSamples).largerVariance());
    ratios.push_back((1 + nevs.back()) / (1 + own[static_cast<std::size_t>(i)]));
  }
  nlohmann::ordered_json row{{"lobe", fmt::format("{} {:.3f}", distribution, alpha)}, {"way", way}};
  addQualities(nevs, ratios, row);
  return row;
}

/// Fits all levels. Those too narrow to be fitted are left out, because the renderer samples the BSDF there.
std::vector<FittedLevel> fitLevels(const char* distribution, const std::string& way) {
  std::vector<FittedLevel> levels;
  for (int i = 0; i < kRoughnessLevels; ++i) {
    const double alpha = roughnessOfLevel(i);
    const CompileJob job = planCompile({{conductorLobe(distribution, alpha), {}}}, optionsOf(way)).front();
    FittedLevel level{alpha, job.grid, fitGrid(*job.use.lobe, job.grid, job.info.settings)};
    if (!level.fit.components.empty()) levels.push_back(std::move(level));
  }
  return levels;
}

void runLevels(const Options& o) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const char* distribution : {"ggx", "beckmann"}) {
    for (const std::string& way : o.ways) {
      const std::vector<FittedLevel> levels = fitLevels(distribution, way);
      for (std::size_t i = 1; i < levels.size(); ++i)
        rows.push_back(measureBetween(distribution, way, levels[i - 1], levels[i]));
    }
  }
  fmt::print("{}\n", jsonText(rows));
}

void run(const Options& o) {
  // One thread, so that times measure the work.
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  ReadOptions read = o.read;
  read.geometry = false;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  const std::vector<LobeUse> uses = collectLobes(readScene(o.scene, read));
  Progress progress("fitting", static_cast<double>(uses.size() * o.ways.size()));
  for (const LobeUse& use : uses) {
    const std::vector<double> own = ownNevs(*use.lobe, optionsOf("ceres"));
    for (const std::string& way : o.ways) {
      rows.push_back(measure(use, way, own));
      progress.advance();
    }
  }
  fmt::print("{}\n", jsonText(rows));
}

void declare(CLI::App& app, Options& o) {
  auto* scene = app.add_option("scene", o.scene, "Mitsuba scene file (XML) whose lobes are fitted");
  auto* levels =
      app.add_flag("--levels", o.levels, "Fit the levels of textured roughness instead, and grade between them");
  levels->excludes(scene);
  app.add_option("--way", o.ways, "Fit method: wem, ceres, eq8 or auto:QUALITY; may be repeated")->required();
  addDefinitions(app, o.read.definitions);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return lobe::runTool(
      "lobebench-caches",
      "Fits the lobes of a scene with several methods and measures the relative variance (NEV) of look-ups; prints "
      "JSON.",
      argc, argv, [&](CLI::App& app) { declare(app, options); },
      [&] {
        if (options.levels) return runLevels(options);
        if (options.scene.empty()) throw UsageError("a scene or --levels is required");
        run(options);
      });
}
