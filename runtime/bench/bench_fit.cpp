// lobebench-fit: time and relative variance (NEV) of fits of one record by each method, compared with Ceres with
// automatic derivatives; and the time of method auto for a whole lobe.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "fitter/compile.h"
#include "fitter/lobe_fit.h"
#include "fitter/nonlinear_fit.h"
#include "materials/registry.h"
#include "runtime/bench/automatic_fit.h"
#include "runtime/core/statistics.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/tool.h"

namespace {

using namespace lobe;

constexpr std::uint32_t kGradeSamples = 16384;
constexpr double kElevations[] = {0, 15, 30, 45, 60, 70, 75, 80, 85, 88, 89, 89.5};
constexpr double kLastGated = 88;  // degrees; beyond it grazing light is too rare to matter
constexpr double kNeighbour = 1;   // degrees, the spacing of a fine grid

struct Options {
  std::uint32_t components = 8;
  std::string surface;
  int repeats = 3;
  bool automatic = true;
  bool json = false;
};

struct Surface {
  std::string distribution;
  double alphaU, alphaV;
  std::string name() const {
    return alphaU == alphaV ? fmt::format("{} {}", distribution, alphaU)
                            : fmt::format("{} {}×{}", distribution, alphaU, alphaV);
  }
  LobePtr lobe() const {
    Parameters parameters;
    parameters.set("distribution", distribution);
    parameters.set("alpha_u", alphaU);
    parameters.set("alpha_v", alphaV);
    return makeBsdf("roughconductor", parameters)->lobes().front();
  }
};

std::vector<Surface> surfaces() {
  std::vector<Surface> all;
  for (const char* distribution : {"ggx", "beckmann"}) {
    for (const double alpha : {0.02, 0.05, 0.1, 0.2, 0.3, 0.5}) all.push_back({distribution, alpha, alpha});
    all.push_back({distribution, 0.05, 0.2});
    all.push_back({distribution, 0.1, 0.4});
  }
  return all;
}

Vec3 direction(double degrees) {
  const double theta = degrees * std::numbers::pi / 180, phi = 0.5;
  return {static_cast<float>(std::sin(theta) * std::cos(phi)), static_cast<float>(std::sin(theta) * std::sin(phi)),
          static_cast<float>(std::cos(theta))};
}

struct Row {
  std::string surface, method;
  double elevation, milliseconds, nev;
};

/// The fit of a whole lobe by method auto on one thread.
struct WholeLobe {
  std::string surface;
  int directions;
  std::size_t records;
  double milliseconds;
};

/// A mixture and the median time of making it, in milliseconds.
template <class F>
std::pair<Mixture, double> timed(int repeats, const F& make) {
  std::vector<double> times;
  Mixture mixture;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    mixture = make();
    times.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  std::ranges::sort(times);
  return {mixture, times[times.size() / 2]};
}

FitSettings settingsFor(FitMethod method, const Options& o) {
  FitSettings settings;
  settings.method = method;
  settings.components = o.components;
  settings.reduction = 0;
  return settings;
}

/// The mixture of a neighbouring direction, shifted as between consecutive directions of a grid.
Mixture movedTo(const Vec3& wo, const Vec3& from, Mixture mixture) {
  const Vec2 step = toDisc(from) - toDisc(wo);
  for (Gaussian& g : mixture) g.meanX += step.x(), g.meanY += step.y();
  return mixture;
}

Mixture automaticFit(const Lobe& lobe, const Vec3& wo, const Options& o) {
  const FitSettings settings = settingsFor(FitMethod::wem, o);
  const Mixture start = fitLobe(lobe, wo, settings).mixture;
  NonlinearFitOptions options;
  options.objective = FitObjective::reflectance;
  options.points = settings.samples;
  return refineAutomatically(fitPoints(lobe, wo, start, options), start);
}

void measure(const Surface& surface, double elevation, const Options& o, std::vector<Row>& rows) {
  const LobePtr lobe = surface.lobe();
  const Vec3 wo = direction(elevation), beside = direction(std::abs(elevation - kNeighbour));
  const auto add = [&](const char* method, int repeats, const auto& make) {
    const auto [mixture, milliseconds] = timed(repeats, make);
    const Quality quality = gradeMixture(*lobe, wo, mixture, kGradeSamples);
    rows.push_back({surface.name(), method, elevation, milliseconds, std::max(quality.nev, quality.coverage)});
  };
  for (const FitMethod method : {FitMethod::wem, FitMethod::eq8, FitMethod::ceres})
    add(nameOf(method), o.repeats, [&] { return fitLobe(*lobe, wo, settingsFor(method, o)).mixture; });
  const Mixture start = movedTo(wo, beside, fitLobe(*lobe, beside, settingsFor(FitMethod::ceres, o)).mixture);
  add("neighbour", o.repeats, [&] { return fitLobe(*lobe, wo, settingsFor(FitMethod::ceres, o), start).mixture; });
  if (o.automatic) add("automatic", 1, [&] { return automaticFit(*lobe, wo, o); });
}

WholeLobe measureAuto(const Surface& surface) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  const CompileJob job = planCompile({{surface.lobe(), {}}}, {}).front();
  const auto start = std::chrono::steady_clock::now();
  const std::size_t records = fitGrid(*job.use.lobe, job.grid, job.info.settings).records.size();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return {surface.name(), workOf(job), records, 1000 * seconds};
}

void printMethod(const std::string& surface, const std::string& method, const std::vector<Row>& rows) {
  std::vector<double> times, nevs;
  double gated = 0;
  for (const Row& r : rows) {
    if (r.surface != surface || r.method != method) continue;
    times.push_back(r.milliseconds);
    nevs.push_back(r.nev);
    if (r.elevation <= kLastGated) gated = std::max(gated, r.nev);
  }
  if (times.empty()) return;
  fmt::print("{:18} {:10} {:9.1f} {:9.4f} {:9.4f} {:9.4f}\n", surface, method, median(times), median(nevs), gated,
             std::ranges::max(nevs));
}

void printTable(const std::string& surface, const std::vector<Row>& rows) {
  for (const char* method : {"wem", "eq8", "automatic", "ceres", "neighbour"}) printMethod(surface, method, rows);
  std::fflush(stdout);
}

double medianTime(const std::string& surface, const char* method, const std::vector<Row>& rows) {
  std::vector<double> times;
  for (const Row& r : rows)
    if (r.surface == surface && r.method == method) times.push_back(r.milliseconds);
  return median(times);
}

void printRatio(const char* what, const std::vector<double>& ratios) {
  double logs = 0;
  for (const double r : ratios) logs += std::log(r) / static_cast<double>(ratios.size());
  fmt::print("  {:52} {:6.1f} {:6.1f} {:6.1f}\n", what, std::exp(logs), std::ranges::min(ratios),
             std::ranges::max(ratios));
}

/// Prints the time of the fit with automatic derivatives divided by that of the other fits.
void printRatios(const std::vector<Row>& rows, const std::vector<WholeLobe>& lobes) {
  std::vector<double> scratch, chained, record, entry;
  for (const WholeLobe& l : lobes) {
    const double automatic = medianTime(l.surface, "automatic", rows);
    scratch.push_back(automatic / medianTime(l.surface, "ceres", rows));
    chained.push_back(automatic / medianTime(l.surface, "neighbour", rows));
    record.push_back(automatic * static_cast<double>(l.records) / l.milliseconds);
    entry.push_back(automatic * l.directions / l.milliseconds);
  }
  fmt::print("\ntime of automatic derivatives over that of               mean    min    max\n");
  printRatio("ceres, including its grading", scratch);
  printRatio("ceres from a neighbour, including its grading", chained);
  printRatio("auto for a whole lobe, per record", record);
  printRatio("auto for a whole lobe, per direction", entry);
}

void printJson(const std::vector<Row>& rows, const std::vector<WholeLobe>& lobes, const Options& o) {
  nlohmann::ordered_json json{{"records", nlohmann::ordered_json::array()}, {"auto", nlohmann::ordered_json::array()}};
  for (const Row& r : rows)
    json["records"].push_back({{"surface", r.surface},
                               {"method", r.method},
                               {"components", o.components},
                               {"elevation", r.elevation},
                               {"milliseconds", r.milliseconds},
                               {"nev", r.nev}});
  for (const WholeLobe& l : lobes)
    json["auto"].push_back({{"surface", l.surface},
                            {"directions", l.directions},
                            {"records", l.records},
                            {"milliseconds", l.milliseconds}});
  fmt::print("{}\n", jsonText(json));
}

void run(const Options& o) {
  if (!o.json) fmt::print("surface            method     ms/record NEV median  to {}°     worst\n", kLastGated);
  std::vector<Row> rows;
  std::vector<WholeLobe> lobes;
  for (const Surface& surface : surfaces()) {
    if (surface.name().find(o.surface) == std::string::npos) continue;
    for (const double elevation : kElevations) measure(surface, elevation, o, rows);
    lobes.push_back(measureAuto(surface));
    if (!o.json) printTable(surface.name(), rows);
  }
  if (o.json)
    printJson(rows, lobes, o);
  else if (o.automatic && !lobes.empty())
    printRatios(rows, lobes);
}

void declare(CLI::App& app, Options& o) {
  app.add_option("--components", o.components, "Gaussians per record: 1, 2, 4 or 8");
  app.add_option("--surface", o.surface, "Only surfaces whose names contain this text, such as 'ggx 0.1'");
  app.add_option("--repeats", o.repeats, "Number of runs; the median time is reported");
  app.add_flag("!--no-automatic", o.automatic, "Leave out the slow fit with automatic derivatives");
  app.add_flag("--json", o.json, "Print every record as JSON");
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return lobe::runTool(
      "lobebench-fit", "Measures the time and the relative variance (NEV) of fits of one record by each method.", argc,
      argv, [&](CLI::App& app) { declare(app, options); }, [&] { run(options); });
}
