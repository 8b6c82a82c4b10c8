#include "runtime/tools/cache_diff.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "runtime/core/printable.h"
#include "runtime/mixture/lookup.h"
#include "runtime/tools/cache_grid.h"
#include "runtime/tools/cache_report.h"
#include "runtime/tools/tool.h"

namespace lobe {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kAlike = 1e-3;

/// The header fields of a cache, in the same order for every cache.
std::vector<std::pair<std::string, std::string>> fieldsOf(const LobeCache& cache) {
  const LobeCacheInfo& info = cache.info();
  const FitSettings& s = info.settings;
  const DirectionGrid grid = gridOf(cache);
  return {{"format", fmt::format("{}.{}", cache.header().major, cache.header().minor)},
          {"tool_version", info.toolVersion},
          {"model", info.model},
          {"model_revision", std::to_string(info.modelRevision)},
          {"lobe", info.summary},
          {"key", info.key},
          {"settings.method", nameOf(s.method)},
          {"settings.components", std::to_string(s.components)},
          {"settings.samples", std::to_string(s.samples)},
          {"settings.reduction", fmt::format("{}", s.reduction)},
          {"settings.revision", std::to_string(s.revision)},
          {"settings.quality", fmt::format("{}", s.quality)},
          {"settings.fixed_grid", s.fixedGrid ? "yes" : "no"},
          {"grid.kind", gridName(grid)},
          {"grid.quarter", cache.info().quarter ? "yes" : "no"},
          {"grid.count", std::to_string(grid.count)}};
}

const CacheRecord& recordOf(const LobeCache& cache, int index) {
  return cache.records()[static_cast<std::size_t>(index)];
}

template <class T>
bool sameBytes(std::span<const T> a, std::span<const T> b) {
  return std::ranges::equal(std::as_bytes(a), std::as_bytes(b));
}

bool sameRecord(const LobeCache& a, const LobeCache& b, const RecordPair& pair) {
  CacheRecord first = recordOf(a, pair.a), second = recordOf(b, pair.b);
  const bool sameMixture = sameBytes(a.components(first), b.components(second));
  // The position of the components in the file is not a property of the record.
  first.first = second.first = 0;
  return sameMixture && sameBytes(std::span<const CacheRecord>(&first, 1), std::span<const CacheRecord>(&second, 1));
}

void countQuality(CacheDifference& d, const CacheRecord& a, const CacheRecord& b) {
  if (!graded(a) || !graded(b)) return;
  const double change = (1.0 + b.nev) / (1.0 + a.nev) - 1;
  if (std::abs(change) <= kAlike)
    ++d.alike;
  else
    ++(change < 0 ? d.better : d.worse);
}

Json recordJson(const LobeCache& cache, int index) {
  const CacheRecord& r = recordOf(cache, index);
  return {{"record", index},
          {"components", r.count},
          {"nev", gradeJson(r, r.nev)},
          {"nev_coverage", gradeJson(r, r.nevCoverage)},
          {"worst_ratio", gradeJson(r, r.worstRatio)},
          {"outside", gradeJson(r, r.outside)}};
}

Angles anglesAt(const LobeCache& cache, int index) {
  return anglesOf(directionOf(cache, static_cast<std::size_t>(index)));
}

void printFields(const CacheDifference& d, std::FILE* out) {
  if (d.fields.empty()) return;
  Table table({"", "A", "B"}, 3);
  for (const FieldDifference& f : d.fields) table.add({f.name, printable(f.a), printable(f.b)});
  table.print(out);
  fmt::print(out, "\n");
}

void printRecordPairs(const CacheDifference& d, const CachePair& caches, std::FILE* out) {
  if (std::ranges::all_of(d.records, &RecordPair::same)) return;
  Table table({"record A", "B", "elevation", "azimuth", "NEV A", "B", "coverage A", "B", "comp. A", "B", "outside A",
               "B", "worst f/p A", "B"});
  for (const RecordPair& pair : d.records) {
    if (pair.same) continue;
    const CacheRecord &a = recordOf(caches.a, pair.a), &b = recordOf(caches.b, pair.b);
    const Angles angles = anglesAt(caches.a, pair.a);
    table.add({std::to_string(pair.a), std::to_string(pair.b), fmt::format("{:.2f}", angles.elevation),
               fmt::format("{:.2f}", angles.azimuth), gradeText(a, fmt::format("{:.4f}", a.nev)),
               gradeText(b, fmt::format("{:.4f}", b.nev)), gradeText(a, fmt::format("{:.4f}", a.nevCoverage)),
               gradeText(b, fmt::format("{:.4f}", b.nevCoverage)), componentsText(a), componentsText(b),
               gradeText(a, fmt::format("{:.2f} %", 100 * a.outside)),
               gradeText(b, fmt::format("{:.2f} %", 100 * b.outside)),
               gradeText(a, fmt::format("{:.3f}", a.worstRatio)), gradeText(b, fmt::format("{:.3f}", b.worstRatio))});
  }
  table.print(out);
  fmt::print(out, "\n");
}

}  // namespace

CacheDifference compareCaches(const LobeCache& a, const LobeCache& b) {
  const DirectionGrid gridA = gridOf(a), gridB = gridOf(b);
  CacheDifference d;
  d.equal = a.hash() == b.hash();
  d.sameLobe = a.info().key == b.info().key;
  d.sameGrid = gridA.kind == gridB.kind && gridA.count == gridB.count;
  const auto fieldsA = fieldsOf(a), fieldsB = fieldsOf(b);
  for (std::size_t i = 0; i < fieldsA.size(); ++i)
    if (fieldsA[i] != fieldsB[i]) d.fields.push_back({fieldsA[i].first, fieldsA[i].second, fieldsB[i].second});
  for (std::size_t i = 0; i < a.records().size(); ++i) {
    const Vec3 wo = directionOf(a, i);
    const Mirror mirror = b.info().quarter ? Mirror::intoQuadrant(wo) : Mirror{};
    const auto entry = static_cast<std::uint32_t>(gridB.nearest(mirror(wo)));
    RecordPair pair{static_cast<int>(i), static_cast<int>(b.lookup(entry)), false};
    pair.same = sameRecord(a, b, pair);
    countQuality(d, recordOf(a, pair.a), recordOf(b, pair.b));
    d.records.push_back(pair);
  }
  return d;
}

void printDifference(const CacheDifference& d, const CachePair& caches, std::FILE* out) {
  fmt::print(out, "A  {}\nB  {}\n\n", caches.pathA.string(), caches.pathB.string());
  if (d.equal) return fmt::print(out, "equal\n");
  if (!d.sameLobe) fmt::print(out, "These are different lobes.\n\n");
  printFields(d, out);
  if (!d.sameGrid)
    fmt::print(out, "The grids differ: each record of A is paired with the record of B that serves its direction.\n\n");
  printRecordPairs(d, caches, out);
  const LobeCacheInfo &a = caches.a.info(), &b = caches.b.info();
  printReports({{"A", "A " + a.summary, {}, summarise(caches.a)}, {"B", "B " + b.summary, {}, summarise(caches.b)}},
               false, out);
  fmt::print(out,
             "\nOf {} records of A, compared by NEV: B is better in {}, worse in {}, equal in {} ({} are identical)\n",
             d.records.size(), d.better, d.worse, d.alike, std::ranges::count_if(d.records, &RecordPair::same));
}

Json toJson(const CacheDifference& d, const CachePair& caches) {
  Json json{{"equal", d.equal},   {"same_lobe", d.sameLobe}, {"same_grid", d.sameGrid}, {"fields", Json::array()},
            {"better", d.better}, {"worse", d.worse},        {"alike", d.alike}};
  for (const FieldDifference& f : d.fields) json["fields"].push_back({{"name", f.name}, {"a", f.a}, {"b", f.b}});
  json["a"] = {{"file", caches.pathA.string()}, {"summary", toJson(summarise(caches.a))}};
  json["b"] = {{"file", caches.pathB.string()}, {"summary", toJson(summarise(caches.b))}};
  json["records"] = Json::array();
  for (const RecordPair& pair : d.records) {
    const Angles angles = anglesAt(caches.a, pair.a);
    json["records"].push_back({{"elevation", angles.elevation},
                               {"azimuth", angles.azimuth},
                               {"same", pair.same},
                               {"a", recordJson(caches.a, pair.a)},
                               {"b", recordJson(caches.b, pair.b)}});
  }
  return json;
}

}  // namespace lobe
