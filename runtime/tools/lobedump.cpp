// lobedump FILE...: shows the content and the quality of BRDF caches (.lobe) and of trained illumination (.illum), as
// tables, JSON, plots, interactive pages, point clouds or differences.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "fitter/compile.h"
#include "runtime/core/atomic_file.h"
#include "runtime/core/files.h"
#include "runtime/core/printable.h"
#include "runtime/tools/cache_diff.h"
#include "runtime/tools/cache_grid.h"
#include "runtime/tools/cache_page.h"
#include "runtime/tools/cache_plot.h"
#include "runtime/tools/cache_report.h"
#include "runtime/tools/illumination_report.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/tool.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_lobes.h"
#include "schema/checkpoint_file.h"

namespace {

using namespace lobe;

constexpr int kPlotRows = 5;

const char* const kFooter =
    R"(--plot draws one row of panels per record, over the equal-area disc of sampled directions (x points right, y up;
the edge is the horizon; outgoing directions of azimuth 0 lie on the positive x axis). Narrow lobes are enlarged.
  1 target  lobe times cosine, normalised (only with --scene)
  2 fit     mixture times cosine, normalised, with the one-sigma ellipses of its components in red
            Target and fit: a logarithmic scale of three decades below the peak of the row, dark violet to light yellow.
  3 ratio   target over the graded density (0.1 BSDF + 0.9 fit), from blue (1/10 or less: sampled too often) over
            white (1) to red (10 or more: sampled too rarely); only with --scene
A ring marks the worst f/p, the largest ratio found in grading; it is at the border if it is out of view. The area
outside the disc is grey. A table lists the record and the view of each row.

--diff exits with 0 if the two caches are identical, with 1 if they differ, and with 2 on an error.)";

struct Options {
  std::vector<std::string> files;
  bool records = false;
  bool json = false;
  bool diff = false;
  std::string plot, html, scene, points;
  int record = -1;
  ReadOptions read;
};

void declare(CLI::App& app, Options& o) {
  app.add_option("files", o.files, "BRDF caches (.lobe) or trained illumination (.illum)")
      ->required()
      ->type_name("FILE")
      ->default_str("");
  auto* records = app.add_flag("--records", o.records, "Also print one row per record");
  auto* json = app.add_flag("--json", o.json, "Print everything as JSON (records of .illum files only with --records)");
  app.add_flag("--diff", o.diff, "Compare two BRDF caches")->excludes(records);
  auto* plot =
      app.add_option("--plot", o.plot, "Plot target, fit and ratio of records of one BRDF cache to this PNG file")
          ->type_name("OUT.png")
          ->default_str("")
          ->excludes(records)
          ->excludes(json)
          ->excludes("--diff");
  app.add_option(
         "--record", o.record,
         "Index of the only record to plot (default: up to five of those with a fit, from the first to the last)")
      ->check(CLI::NonNegativeNumber)
      ->default_str("")
      ->needs(plot);
  app.add_option("--html", o.html,
                 "Write an interactive page of BRDF caches or of illumination to this file, which needs no other file")
      ->type_name("OUT.html")
      ->default_str("")
      ->excludes(records)
      ->excludes(json)
      ->excludes(plot)
      ->excludes("--diff");
  app.add_option("--scene", o.scene,
                 "Scene from which the caches were made; needed to show target and ratio with --plot or --html")
      ->type_name("SCENE.xml")
      ->default_str("");
  app.add_option("--points", o.points, "Write the records of one .illum file as a point cloud")
      ->type_name("OUT.ply")
      ->default_str("")
      ->excludes(records)
      ->excludes(json)
      ->excludes(plot)
      ->excludes("--html")
      ->excludes("--diff");
  addDefinitions(app, o.read.definitions);
  app.footer(kFooter);
}

void validate(const Options& o) {
  if (o.diff && o.files.size() != 2) throw UsageError("--diff needs two cache files");
  if (!o.points.empty()) {
    if (o.files.size() != 1) throw UsageError("--points needs exactly one .illum file");
    if (extensionOf(o.points) != ".ply") throw UsageError(fmt::format("--points {}: must be a .ply file", o.points));
  }
  if (!o.scene.empty() && o.plot.empty() && o.html.empty()) throw UsageError("--scene needs --plot or --html");
  if (!o.read.definitions.empty() && o.scene.empty()) throw UsageError("-D needs --scene");
  std::vector<std::filesystem::path> inputs(o.files.begin(), o.files.end());
  inputs.emplace_back(o.scene);
  checkOutputs({o.points, o.plot, o.html}, inputs);
  if (!o.html.empty() && extensionOf(o.html) != ".html")
    throw UsageError(fmt::format("--html {}: must be an .html file", o.html));
  if (o.plot.empty()) return;
  if (o.files.size() != 1) throw UsageError("--plot needs exactly one cache file");
  if (extensionOf(o.plot) != ".png") throw UsageError(fmt::format("--plot {}: must be a .png file", o.plot));
}

// ---- Tables

void printJson(const std::vector<LobeCache>& caches, const Options& o) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < caches.size(); ++i) json.push_back(toJson(caches[i], o.files[i]));
  fmt::print("{}\n", jsonText(json));
}

void printText(const std::vector<LobeCache>& caches, const Options& o) {
  std::vector<CacheReport> reports;
  for (std::size_t i = 0; i < caches.size(); ++i) {
    printHeader(caches[i], o.files[i], stdout);
    if (o.records) printRecords(caches[i], stdout);
    fmt::print("\n");
    reports.push_back({o.files[i], caches[i].info().summary, {}, summarise(caches[i]), true, 0});
  }
  printReports(reports, false, stdout);
}

// ---- Differences

bool runDiff(const LobeCache& a, const LobeCache& b, const Options& o) {
  const CacheDifference difference = compareCaches(a, b);
  const CachePair caches{a, b, o.files[0], o.files[1]};
  if (o.json)
    fmt::print("{}\n", jsonText(toJson(difference, caches)));
  else
    printDifference(difference, caches, stdout);
  return difference.equal;
}

// ---- Plots

/// The lobes of the scene of --scene; none if it is not given. output: must be none of the files that are read.
std::vector<LobeUse> lobesOfScene(Options& o, const std::string& output) {
  if (o.scene.empty()) return {};
  o.read.geometry = false;
  // Parts of the scene that the reader does not support cannot contain the lobe.
  o.read.lenient = true;
  const Scene scene = readScene(o.scene, o.read);
  checkOutputs({output}, scene.files);
  return collectLobes(scene);
}

/// The lobe of a cache; null, if none of the lobes is.
LobePtr lobeOf(const LobeCache& cache, const std::vector<LobeUse>& uses, const std::string& file) {
  const auto found = std::ranges::find_if(uses, [&](const LobeUse& u) { return u.lobe->key() == cache.info().key; });
  if (found == uses.end()) return nullptr;
  if (found->lobe->revision() != cache.info().modelRevision)
    printWarning(
        "lobedump",
        fmt::format("{}: the code of the model has changed since the fit; the target shows the current model", file));
  return found->lobe;
}

std::string noLobe(const LobeCache& cache, const std::string& file, const Options& o) {
  return fmt::format(
      "{}: no material has the lobe of {} ({}, key {}); omit --scene, or give the scene and the -D options from "
      "which the cache was made",
      o.scene, file, printable(cache.info().summary), printable(cache.info().key));
}

/// The indices of the records that have a fit; of the one of --record only, if it is given.
std::vector<int> recordsWithFit(const LobeCache& cache, const Options& o) {
  const int count = static_cast<int>(cache.records().size());
  if (o.record >= count) throw UsageError(fmt::format("--record must be from 0 to {}", count - 1));
  std::vector<int> records;
  for (int i = 0; i < count; ++i)
    if ((o.record < 0 || o.record == i) && graded(cache.records()[static_cast<std::size_t>(i)])) records.push_back(i);
  return records;
}

std::vector<int> chosenRecords(const LobeCache& cache, const Options& o) {
  const std::vector<int> fits = recordsWithFit(cache, o);
  if (fits.empty())
    throw std::runtime_error(fmt::format("{} ({}): {} left to BSDF sampling, so there is no fit to draw", o.files[0],
                                         printable(cache.info().summary),
                                         o.record < 0 ? "all records are" : fmt::format("record {} is", o.record)));
  std::vector<int> chosen;
  for (const int i : spreadRecords(static_cast<int>(fits.size()), kPlotRows))
    chosen.push_back(fits[static_cast<std::size_t>(i)]);
  return chosen;
}

std::string pointText(const Vec2& y) {
  // Adding zero turns -0 into 0.
  const auto rounded = [](float v) { return std::round(1000 * v) / 1000 + 0.0f; };
  return fmt::format("{:.3f}, {:.3f}", rounded(y.x()), rounded(y.y()));
}

void printLegend(const LobeCache& cache, const Plot& plot, const Options& o) {
  fmt::print("{}: {} of {}, one row per record\n", o.plot, o.scene.empty() ? "fit" : "target, fit and ratio",
             printable(cache.info().summary));
  Table table(
      {"row", "record", "elevation", "azimuth", "comp.", "NEV", "worst f/p", "at x, y", "view x, y", "±", "peak"});
  for (std::size_t i = 0; i < plot.rows.size(); ++i) {
    const PlotRow& row = plot.rows[i];
    const CacheRecord& r = cache.records()[static_cast<std::size_t>(row.record)];
    const Angles angles = anglesOf(directionOf(cache, static_cast<std::size_t>(row.record)));
    table.add({std::to_string(i + 1), std::to_string(row.record), fmt::format("{:.2f}", angles.elevation),
               fmt::format("{:.2f}", angles.azimuth), componentsText(r), gradeText(r, fmt::format("{:.4f}", r.nev)),
               gradeText(r, fmt::format("{:.3f}", r.worstRatio)),
               row.grade ? pointText(toDisc(row.grade->worstAt)) : "-", pointText(row.view.centre),
               fmt::format("{:.3f}", row.view.half), fmt::format("{:.4g}", row.peak)});
  }
  table.print(stdout);
}

void runPlot(const LobeCache& cache, Options& o) {
  const std::vector<int> records = chosenRecords(cache, o);
  const LobePtr lobe = lobeOf(cache, lobesOfScene(o, o.plot), o.files[0]);
  if (!lobe && !o.scene.empty()) throw std::runtime_error(noLobe(cache, o.files[0], o));
  const Plot plot = plotRecords(cache, records, lobe.get());
  plot.raster.write(o.plot);
  printLegend(cache, plot, o);
}

// ---- Page

void runPage(const std::vector<LobeCache>& caches, Options& o) {
  const std::vector<LobeUse> uses = lobesOfScene(o, o.html);
  std::vector<LobePtr> lobes;
  std::vector<PagedCache> paged;
  std::size_t records = 0;
  for (std::size_t i = 0; i < caches.size(); ++i) {
    lobes.push_back(lobeOf(caches[i], uses, o.files[i]));
    if (!lobes.back() && !o.scene.empty()) throw std::runtime_error(noLobe(caches[i], o.files[i], o));
    paged.push_back({&caches[i], o.files[i], lobes.back().get()});
    records += caches[i].records().size();
  }
  Progress progress("evaluating", static_cast<double>(records));
  writeAtomically(o.html, lobePage(paged, [&progress] { progress.advance(); }));
}

// ---- Illumination

/// Checkpoints contain illumination, but are files of loberender only.
bool isIllumination(const std::string& file) {
  const FileContent content(file);
  if (isOfKind(kCheckpointFormat, content.bytes()))
    throw std::runtime_error(fmt::format("{}: a checkpoint; lobedump reads .lobe and .illum files", file));
  return isOfKind(kIlluminationFormat, content.bytes());
}

void validateForIllumination(const Options& o) {
  if (o.diff || !o.plot.empty() || !o.scene.empty())
    throw UsageError("--diff, --plot and --scene work on BRDF caches (.lobe) only");
  if (!std::ranges::all_of(o.files, isIllumination))
    throw UsageError("BRDF caches (.lobe) and illumination (.illum) need separate runs");
}

void runIllumination(const Options& o) {
  validateForIllumination(o);
  std::vector<IlluminationFile> files;
  for (const std::string& file : o.files) files.push_back(IlluminationFile::open(file));
  if (!o.points.empty()) return writePoints(files[0], o.points);
  if (!o.html.empty()) return writeAtomically(o.html, illuminationPage(files, o.files));
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (o.json) {
      json.push_back(toJson(files[i], o.files[i], o.records));
      continue;
    }
    if (i > 0) fmt::print("\n");
    printIllumination(files[i], o.files[i], stdout);
    if (o.records) printRecords(files[i], stdout);
  }
  if (o.json) fmt::print("{}\n", jsonText(json));
}

/// Returns false if --diff found a difference.
bool run(Options& o) {
  validate(o);
  if (std::ranges::any_of(o.files, isIllumination)) {
    runIllumination(o);
    return true;
  }
  if (!o.points.empty()) throw UsageError("--points works on .illum files only");
  std::vector<LobeCache> caches;
  for (const std::string& file : o.files) caches.push_back(LobeCache::open(file));
  if (o.diff) return runDiff(caches[0], caches[1], o);
  if (!o.plot.empty())
    runPlot(caches[0], o);
  else if (!o.html.empty())
    runPage(caches, o);
  else
    o.json ? printJson(caches, o) : printText(caches, o);
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool same = true;
  const int code = lobe::runTool(
      "lobedump", "Shows the content and the quality of BRDF caches and of trained illumination.", argc, argv,
      [&](CLI::App& app) { declare(app, options); }, [&] { same = run(options); });
  // As in cmp, where 1 only means that the files differ.
  if (options.diff && code == 1) return 2;
  return same ? code : 1;
}
