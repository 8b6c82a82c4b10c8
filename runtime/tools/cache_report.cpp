#include "runtime/tools/cache_report.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "runtime/core/printable.h"
#include "runtime/core/statistics.h"
#include "runtime/tools/cache_grid.h"
#include "runtime/tools/tool.h"

namespace lobe {
namespace {

using Json = nlohmann::ordered_json;

std::string percent(double fraction) {
  return fmt::format("{:.2f} %", 100 * fraction);
}

Json recordJson(const LobeCache& cache, std::size_t index) {
  const CacheRecord& r = cache.records()[index];
  const Angles angles = anglesOf(directionOf(cache, index));
  Json json{{"entry", r.entry},
            {"elevation", angles.elevation},
            {"azimuth", angles.azimuth},
            {"integral", shortNumber(r.integral)},
            {"albedo", shortNumber(r.albedo)},
            {"cosine_mass", gradeJson(r, r.cosineMass)},
            {"outside", gradeJson(r, r.outside)},
            {"nev", gradeJson(r, r.nev)},
            {"nev_coverage", gradeJson(r, r.nevCoverage)},
            {"worst_ratio", gradeJson(r, r.worstRatio)},
            {"components", Json::array()}};
  for (const CacheComponent& c : cache.components(r)) json["components"].push_back(componentJson(c));
  return json;
}

}  // namespace

CacheSummary summarise(const LobeCache& cache) {
  CacheSummary s;
  std::vector<double> nev, coverage;
  for (const CacheRecord& r : cache.records()) {
    s.meanComponents += r.count;
    if (!graded(r)) continue;
    s.outside += r.outside;
    s.worstRatio = std::max(s.worstRatio, static_cast<double>(r.worstRatio));
    nev.push_back(r.nev);
    coverage.push_back(r.nevCoverage);
  }
  s.records = cache.records().size();
  s.meanComponents /= static_cast<double>(s.records);
  s.bytes = cache.bytes();
  s.graded = !nev.empty();
  if (!s.graded) return s;
  s.outside /= static_cast<double>(nev.size());
  s.nevMedian = median(nev);
  s.nevWorst = std::ranges::max(nev);
  s.coverageMedian = median(coverage);
  s.coverageWorst = std::ranges::max(coverage);
  return s;
}

Json gradeJson(const CacheRecord& record, float value) {
  return graded(record) ? shortNumber(value) : Json();
}

std::string gradeText(const CacheRecord& record, const std::string& text) {
  return graded(record) ? text : "-";
}

std::string componentsText(const CacheRecord& record) {
  return graded(record) ? std::to_string(record.count) : "BSDF";
}

Json componentJson(const CacheComponent& c) {
  return {{"weight", shortNumber(c.weight)},
          {"mean", {shortNumber(c.meanX), shortNumber(c.meanY)}},
          {"covariance", {shortNumber(c.covXX), shortNumber(c.covXY), shortNumber(c.covYY)}}};
}

Json shortNumber(float value) {
  return Json::parse(fmt::format("{}", value));
}

std::string abbreviated(const std::vector<std::string>& names) {
  if (names.empty()) return "-";
  return names.size() == 1 ? names.front() : fmt::format("{} + {} more", names.front(), names.size() - 1);
}

void printReports(const std::vector<CacheReport>& reports, bool showRun, std::FILE* out) {
  std::vector<std::string> header{"lobe",     "records", "comp.",     "NEV",     "worst",
                                  "coverage", "worst",   "worst f/p", "outside", "bytes"};
  if (showRun) {
    header.insert(header.begin(), "material");
    header.insert(header.end() - 1, "seconds");
  }
  Table table(header, showRun ? 2 : 1);
  for (const CacheReport& r : reports) {
    const CacheSummary& s = r.summary;
    const auto grade = [&](const std::string& text) { return s.graded ? text : "-"; };
    std::vector<std::string> cells{printable(r.lobe),
                                   std::to_string(s.records),
                                   s.graded ? fmt::format("{:.2f}", s.meanComponents) : "BSDF",
                                   grade(fmt::format("{:.3f}", s.nevMedian)),
                                   grade(fmt::format("{:.3f}", s.nevWorst)),
                                   grade(fmt::format("{:.3f}", s.coverageMedian)),
                                   grade(fmt::format("{:.3f}", s.coverageWorst)),
                                   grade(fmt::format("{:.2f}", s.worstRatio)),
                                   grade(percent(s.outside)),
                                   std::to_string(s.bytes)};
    if (showRun) {
      cells.insert(cells.begin(), abbreviated(r.materials));
      cells.insert(cells.end() - 1, r.upToDate ? "up to date" : fmt::format("{:.1f}", r.seconds));
    }
    table.add(std::move(cells));
  }
  table.print(out);
}

Json toJson(const CacheSummary& s) {
  const auto grade = [&](double value) { return s.graded ? Json(value) : Json(); };
  return {{"records", s.records},
          {"mean_components", s.meanComponents},
          {"nev_median", grade(s.nevMedian)},
          {"nev_worst", grade(s.nevWorst)},
          {"nev_coverage_median", grade(s.coverageMedian)},
          {"nev_coverage_worst", grade(s.coverageWorst)},
          {"worst_ratio", grade(s.worstRatio)},
          {"outside", grade(s.outside)},
          {"bytes", s.bytes}};
}

Json toJson(const CacheReport& r) {
  Json json{{"file", r.path.string()}, {"lobe", r.lobe}, {"materials", r.materials}};
  json.update(toJson(r.summary));
  json["up_to_date"] = r.upToDate;
  json["seconds"] = r.seconds;
  return json;
}

Json toJson(const LobeCache& cache, const std::filesystem::path& path) {
  const LobeCacheInfo& info = cache.info();
  const DirectionGrid grid = gridOf(cache);
  Json json{{"file", path.string()},
            {"format", fmt::format("{}.{}", cache.header().major, cache.header().minor)},
            {"hash", fmt::format("{:016x}", cache.hash())},
            {"tool_version", info.toolVersion},
            {"model", info.model},
            {"model_revision", info.modelRevision},
            {"lobe", info.summary},
            {"key", info.key},
            {"settings",
             {{"method", nameOf(info.settings.method)},
              {"components", info.settings.components},
              {"samples", info.settings.samples},
              {"reduction", shortNumber(info.settings.reduction)},
              {"revision", info.settings.revision},
              {"quality", shortNumber(info.settings.quality)},
              {"fixed_grid", info.settings.fixedGrid}}},
            {"grid", {{"kind", gridName(grid)}, {"count", grid.count}, {"quarter", info.quarter}}},
            {"summary", toJson(summarise(cache))},
            {"records", Json::array()}};
  for (int i = 0; i < grid.count; ++i) json["grid"]["lookup"].push_back(cache.lookup(static_cast<std::uint32_t>(i)));
  for (std::size_t i = 0; i < cache.records().size(); ++i) json["records"].push_back(recordJson(cache, i));
  return json;
}

void printHeader(const LobeCache& cache, const std::filesystem::path& path, std::FILE* out) {
  const LobeCacheInfo& info = cache.info();
  const FitSettings& s = info.settings;
  const DirectionGrid grid = gridOf(cache);
  fmt::print(out, "{}\n", path.string());
  fmt::print(out, "  lobe      {} (model {}, revision {})\n", printable(info.summary), printable(info.model),
             info.modelRevision);
  fmt::print(out, "  key       {}\n", printable(info.key));
  fmt::print(out, "  written   by Lobe {}, format {}.{}, hash {:016x}\n", printable(info.toolVersion),
             cache.header().major, cache.header().minor, cache.hash());
  fmt::print(out, "  fit       {}, {} components, {} samples, reduction {}, quality {}, revision {}\n",
             nameOf(s.method), s.components, s.samples, s.reduction, s.quality, s.revision);
  fmt::print(out, "  grid      {}, {} directions, {}\n", gridName(grid), grid.count,
             s.fixedGrid ? "one record each" : fmt::format("served by {} records", cache.records().size()));
}

void printRecords(const LobeCache& cache, std::FILE* out) {
  Table table({"record", "elevation", "azimuth", "comp.", "integral", "albedo", "cosine mass", "outside", "NEV",
               "coverage", "worst f/p"});
  for (std::size_t i = 0; i < cache.records().size(); ++i) {
    const CacheRecord& r = cache.records()[i];
    const Angles angles = anglesOf(directionOf(cache, i));
    table.add({std::to_string(i), fmt::format("{:.2f}", angles.elevation), fmt::format("{:.2f}", angles.azimuth),
               componentsText(r), fmt::format("{:.5g}", r.integral), fmt::format("{:.5f}", r.albedo),
               gradeText(r, fmt::format("{:.5f}", r.cosineMass)), gradeText(r, percent(r.outside)),
               gradeText(r, fmt::format("{:.4f}", r.nev)), gradeText(r, fmt::format("{:.4f}", r.nevCoverage)),
               gradeText(r, fmt::format("{:.3f}", r.worstRatio))});
  }
  table.print(out);
}

}  // namespace lobe
