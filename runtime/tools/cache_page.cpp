#include "runtime/tools/cache_page.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "runtime/analysis/colour_map.h"
#include "runtime/core/parallel.h"
#include "runtime/tools/cache_grid.h"
#include "runtime/tools/cache_plot.h"
#include "runtime/tools/cache_report.h"
#include "runtime/tools/json_text.h"
#include "runtime/tools/plotted_record.h"

namespace lobe {

/// The template (cache_page.html), which the build turns into a string.
extern const char* const kCachePage;

namespace {

using Json = nlohmann::ordered_json;

// Cells along a side of the stored grid of a target, and the memory for all grids of a cache that they are chosen for.
constexpr int kMostCells = 80, kFewestCells = 16;
constexpr double kGridBytes = 6e6;

// ---- Encoding

std::string base64(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < count ? std::to_integer<std::uint32_t>(bytes[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

template <class Value>
std::string base64(const std::vector<Value>& values) {
  return base64(std::as_bytes(std::span(values)));
}

Json colours(Colour (*colourOf)(double), double from, double to) {
  Json table = Json::array();
  for (int i = 0; i < 256; ++i) {
    const Colour c = colourOf(from + (to - from) * i / 255);
    table.push_back({std::lround(255 * c[0]), std::lround(255 * c[1]), std::lround(255 * c[2])});
  }
  return table;
}

std::string page(const char* kind, const Json& files) {
  const Json data{{"kind", kind},
                  {"decades", kPlotDecades},
                  {"ratio", kPlotRatio},
                  {"sequential", colours(sequentialColour, 0, 1)},
                  {"diverging", colours(divergingColour, -1, 1)},
                  {"files", files}};
  std::string json = jsonText(data, -1);
  // "</script" would end the script element, and "<!--<script" would hide its end. Only strings contain a "<".
  for (std::size_t at = 0; (at = json.find('<', at)) != std::string::npos;) json.replace(at, 1, "\\u003c");
  std::string text = kCachePage;
  constexpr std::string_view kPlace = "/* DATA */ null";
  return text.replace(text.find(kPlace), kPlace.size(), json);
}

// ---- BRDF caches

/// A target relative to its peak: 0 for less than 1e-6 of it, otherwise 1 to 65535 on a logarithmic scale.
std::uint16_t packedTarget(double value, double peak) {
  if (!(value > 1e-6 * peak)) return 0;
  return static_cast<std::uint16_t>(1 + std::lround(65534 * (std::log10(std::min(value / peak, 1.0)) + 6) / 6));
}

/// A ratio from 0.01 to 100 on a logarithmic scale.
std::uint16_t packedRatio(double ratio) {
  return static_cast<std::uint16_t>(std::lround(65535 * (std::log10(std::clamp(ratio, 0.01, 100.0)) + 2) / 4));
}

/// The targets and ratios of all records of a cache, in grids of cells × cells; zero outside the disc. Different
/// records may be added at the same time.
class TargetGrids {
 public:
  explicit TargetGrids(std::size_t records)
      : cells_(std::clamp(static_cast<int>(std::sqrt(kGridBytes / (4.0 * static_cast<double>(records)))), kFewestCells,
                          kMostCells)),
        target_(records * static_cast<std::size_t>(cells_) * cells_),
        ratio_(target_.size()) {}

  /// Returns the peak of the target.
  double add(std::size_t index, const PlottedRecord& record, const PlotView& view) {
    const auto count = static_cast<std::size_t>(cells_) * cells_;
    std::vector<double> values(count);
    for (std::size_t i = 0; i < count; ++i) {
      const Vec2 y = centre(view, static_cast<int>(i));
      if (!insideDisc(y)) continue;
      values[i] = record.target(y);
      ratio_[index * count + i] = packedRatio(record.ratio(y));
    }
    const double peak = std::ranges::max(values);
    for (std::size_t i = 0; i < count; ++i) target_[index * count + i] = packedTarget(values[i], peak);
    return peak;
  }

  Json json() const { return {{"cells", cells_}, {"target", base64(target_)}, {"ratio", base64(ratio_)}}; }

 private:
  Vec2 centre(const PlotView& view, int cell) const {
    const auto part = [&](int i) { return (static_cast<float>(i) + 0.5f) / static_cast<float>(cells_) * 2 - 1; };
    return view.centre + view.half * Vec2(part(cell % cells_), -part(cell / cells_));
  }

  int cells_;
  std::vector<std::uint16_t> target_, ratio_;
};

Json pointJson(const Vec2& y) {
  return {shortNumber(y.x()), shortNumber(y.y())};
}

/// grids: null without a lobe.
Json recordJson(const PagedCache& paged, std::size_t index, TargetGrids* grids) {
  const CacheRecord& r = paged.cache->records()[index];
  const Vec3 wo = directionOf(*paged.cache, index);
  const Angles angles = anglesOf(wo);
  Json json{{"first", r.first},
            {"count", r.count},
            {"direction", pointJson(toDisc(wo))},
            {"elevation", angles.elevation},
            {"azimuth", angles.azimuth},
            {"integral", shortNumber(r.integral)},
            {"albedo", shortNumber(r.albedo)},
            {"cosine_mass", gradeJson(r, r.cosineMass)},
            {"outside", gradeJson(r, r.outside)},
            {"nev", gradeJson(r, r.nev)},
            {"coverage", gradeJson(r, r.nevCoverage)},
            {"worst", gradeJson(r, r.worstRatio)}};
  if (!graded(r)) return json;
  const PlottedRecord plotted(*paged.cache, static_cast<int>(index), paged.lobe);
  const PlotView view = plotted.view();
  json["view"] = {shortNumber(view.centre.x()), shortNumber(view.centre.y()), shortNumber(view.half)};
  if (!grids) return json;
  json["target_peak"] = grids->add(index, plotted, view);
  const std::optional<Quality> grade = plotted.grade();
  json["worst_at"] = grade->worst > 0 ? pointJson(toDisc(grade->worstAt)) : Json();
  return json;
}

Json factsOf(const PagedCache& paged) {
  const LobeCacheInfo& info = paged.cache->info();
  const FitSettings& s = info.settings;
  const DirectionGrid grid = gridOf(*paged.cache);
  Json facts = Json::array();
  const auto add = [&](const char* name, const std::string& text) { facts.push_back({name, text}); };
  add("file", paged.path.string());
  add("lobe", fmt::format("{} (model {}, revision {})", info.summary, info.model, info.modelRevision));
  add("key", info.key);
  add("fit", fmt::format("{}, at most {} Gaussians, {} samples, reduction {}, quality {}", nameOf(s.method),
                         s.components, s.samples, s.reduction, s.quality));
  add("grid", fmt::format("{}, {} directions, {} records{}", gridName(grid), grid.count, paged.cache->records().size(),
                          info.quarter ? "; directions are mirrored into one quadrant" : ""));
  add("written by", fmt::format("Lobe {}, {} bytes", info.toolVersion, paged.cache->bytes()));
  return facts;
}

/// With a lobe, a record takes milliseconds.
Json recordsJson(const PagedCache& paged, TargetGrids* grids, const std::function<void()>& advance) {
  std::vector<Json> records(paged.cache->records().size());
  parallelFor(std::size_t{0}, records.size(), [&](std::size_t i) {
    records[i] = recordJson(paged, i, grids);
    advance();
  });
  return records;
}

Json cacheJson(const PagedCache& paged, const std::function<void()>& advance) {
  const LobeCache& cache = *paged.cache;
  const DirectionGrid grid = gridOf(cache);
  std::vector<float> directions;
  std::vector<std::uint32_t> lookup;
  for (int i = 0; i < grid.count; ++i) {
    const Vec3 w = grid.direction(i);
    directions.insert(directions.end(), {w.x(), w.y(), w.z()});
    lookup.push_back(cache.lookup(static_cast<std::uint32_t>(i)));
  }
  Json json{{"file", paged.path.filename().string()},
            {"lobe", cache.info().summary},
            {"facts", factsOf(paged)},
            {"grid", gridName(grid)},
            {"quarter", cache.info().quarter},
            {"directions", base64(directions)},
            {"lookup", base64(lookup)},
            {"components", base64(std::as_bytes(cache.components()))},
            {"cells", 0}};
  std::optional<TargetGrids> grids;
  if (paged.lobe) grids.emplace(cache.records().size());
  json["records"] = recordsJson(paged, grids ? &*grids : nullptr, advance);
  if (grids) json.update(grids->json());
  return json;
}

// ---- Illumination

Json factsOf(const IlluminationFile& file, const std::string& path) {
  const IlluminationInfo& info = file.info();
  const StoredTrainingSettings& s = info.settings;
  return Json::array(
      {{"file", path},
       {"scene", info.scene},
       {"training", fmt::format("from {}, {} passes of {} photons and {} importons, seed {}; {} particles", s.from,
                                s.passes, s.photons, s.importons, s.seed, info.particles)},
       {"records", fmt::format("{}, {:.2f} % undersampled", file.records().size(), 100 * info.undersampledFraction)},
       {"written by", fmt::format("Lobe {}, {} bytes", info.toolVersion, file.bytes())}});
}

Json illuminationJson(const IlluminationFile& file, const std::string& path) {
  std::vector<float> numbers;
  std::vector<CacheComponent> components;
  for (const StoredIllumination& r : file.records()) {
    for (const auto& vector : {r.position, r.normal, r.tangent})
      numbers.insert(numbers.end(), vector.begin(), vector.end());
    numbers.insert(numbers.end(),
                   {r.radius, r.background, r.irradiance, r.samples, r.bsdfFraction, file.likelihoodGain(r),
                    static_cast<float>(components.size()), static_cast<float>(r.count)});
    const std::span<const CacheComponent> ofRecord = file.components(r);
    components.insert(components.end(), ofRecord.begin(), ofRecord.end());
  }
  return {{"file", std::filesystem::path(path).filename().string()},
          {"facts", factsOf(file, path)},
          {"count", file.records().size()},
          {"numbers", base64(numbers)},
          {"components", base64(components)}};
}

}  // namespace

std::string lobePage(std::span<const PagedCache> caches, const std::function<void()>& advance) {
  Json files = Json::array();
  for (const PagedCache& paged : caches) files.push_back(cacheJson(paged, advance));
  return page("lobe", files);
}

std::string illuminationPage(std::span<const IlluminationFile> files, std::span<const std::string> paths) {
  Json all = Json::array();
  for (std::size_t i = 0; i < files.size(); ++i) all.push_back(illuminationJson(files[i], paths[i]));
  return page("illumination", all);
}

}  // namespace lobe
