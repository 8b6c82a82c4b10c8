#include "runtime/tools/illumination_report.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "runtime/core/atomic_file.h"
#include "runtime/core/printable.h"
#include "runtime/tools/cache_report.h"
#include "runtime/tools/tool.h"

namespace lobe {
namespace {

using Json = nlohmann::ordered_json;

struct Quantile {
  const char* name;
  double fraction;
};
constexpr std::array<Quantile, 5> kQuantiles{{{"min", 0}, {"p10", 0.1}, {"median", 0.5}, {"p90", 0.9}, {"max", 1}}};

/// The sorted values of one quantity over all records.
struct Distribution {
  const char* name;
  std::vector<float> values;

  float at(const Quantile& q) const {
    return values[static_cast<std::size_t>(q.fraction * static_cast<double>(values.size() - 1))];
  }
};

template <class Value>
Distribution distributionOf(const IlluminationFile& file, const char* name, const Value& value) {
  Distribution d{name, {}};
  for (const StoredIllumination& r : file.records()) d.values.push_back(static_cast<float>(value(r)));
  std::ranges::sort(d.values);
  return d;
}

/// The distributions of all quantities; empty if there are no records.
std::vector<Distribution> distributions(const IlluminationFile& file) {
  if (file.records().empty()) return {};
  return {distributionOf(file, "radius", [](const auto& r) { return r.radius; }),
          distributionOf(file, "samples", [](const auto& r) { return r.samples; }),
          distributionOf(file, "background", [](const auto& r) { return r.background; }),
          distributionOf(file, "bsdf_fraction", [](const auto& r) { return r.bsdfFraction; }),
          distributionOf(file, "likelihood_gain", [&](const auto& r) { return file.likelihoodGain(r); }),
          distributionOf(file, "irradiance", [](const auto& r) { return r.irradiance; }),
          distributionOf(file, "components", [](const auto& r) { return r.count; })};
}

Json vectorJson(const std::array<float, 3>& v) {
  return {shortNumber(v[0]), shortNumber(v[1]), shortNumber(v[2])};
}

Json recordJson(const IlluminationFile& file, const StoredIllumination& r) {
  Json json{{"position", vectorJson(r.position)},
            {"normal", vectorJson(r.normal)},
            {"tangent", vectorJson(r.tangent)},
            {"radius", shortNumber(r.radius)},
            {"background", shortNumber(r.background)},
            {"irradiance", shortNumber(r.irradiance)},
            {"samples", shortNumber(r.samples)},
            {"bsdf_fraction", shortNumber(r.bsdfFraction)},
            {"likelihood_gain", shortNumber(file.likelihoodGain(r))},
            {"components", Json::array()}};
  for (const CacheComponent& c : file.components(r)) json["components"].push_back(componentJson(c));
  return json;
}

/// Whether paths in training had a maximum length.
bool isLimited(const StoredTrainingSettings& settings) {
  return settings.maxDepth < StoredTrainingSettings().maxDepth;
}

std::string vectorText(const std::array<float, 3>& v) {
  return fmt::format("{:.4g} {:.4g} {:.4g}", v[0], v[1], v[2]);
}

}  // namespace

Json toJson(const IlluminationFile& file, const std::filesystem::path& path, bool withRecords) {
  const IlluminationInfo& info = file.info();
  const StoredTrainingSettings& s = info.settings;
  Json json{{"file", path.string()},
            {"format", fmt::format("{}.{}", file.header().major, file.header().minor)},
            {"tool_version", info.toolVersion},
            {"hash", fmt::format("{:016x}", file.header().hash)},
            {"scene", info.scene},
            {"scene_hash", fmt::format("{:016x}", info.sceneHash)},
            {"settings",
             {{"from", s.from},
              {"passes", s.passes},
              {"photons", s.photons},
              {"importons", s.importons},
              {"components", s.components},
              {"seed", s.seed},
              {"learnt_fractions", s.learntFractions},
              {"max_depth", isLimited(s) ? Json(s.maxDepth) : Json()}}},
            {"particles", info.particles},
            {"unit", shortNumber(info.unit)},
            {"bytes", file.bytes()},
            {"record_count", file.records().size()},
            {"undersampled_fraction", info.undersampledFraction}};
  for (const Distribution& d : distributions(file))
    for (const Quantile& q : kQuantiles) json["distributions"][d.name][q.name] = shortNumber(d.at(q));
  if (!withRecords) return json;
  json["records"] = Json::array();
  for (const StoredIllumination& r : file.records()) json["records"].push_back(recordJson(file, r));
  return json;
}

void printIllumination(const IlluminationFile& file, const std::filesystem::path& path, std::FILE* out) {
  const IlluminationInfo& info = file.info();
  const StoredTrainingSettings& s = info.settings;
  fmt::print(out, "{}\n  scene      {}, hash {:016x}\n", path.string(), printable(info.scene), info.sceneHash);
  fmt::print(out,
             "  settings   trained from {}, {} passes of {} photons and {} importons, {} components, seed {}, {} "
             "fractions{}\n",
             printable(s.from), s.passes, s.photons, s.importons, s.components, s.seed,
             s.learntFractions ? "learnt" : "fixed",
             isLimited(s) ? fmt::format(", paths of up to {} segments", s.maxDepth) : "");
  fmt::print(out, "  training   {} particles; unit of length {:.4g}\n", info.particles, info.unit);
  fmt::print(out, "  records    {}, {:.2f} % undersampled\n", file.records().size(), 100 * info.undersampledFraction);
  fmt::print(out, "  format {}.{}, Lobe {}, {} bytes, hash {:016x}\n", file.header().major, file.header().minor,
             printable(info.toolVersion), file.bytes(), file.header().hash);
  std::vector<std::string> header{"over the records"};
  for (const Quantile& q : kQuantiles) header.emplace_back(q.name);
  Table table(std::move(header));
  for (const Distribution& d : distributions(file)) {
    std::vector<std::string> row{d.name};
    for (const Quantile& q : kQuantiles) row.push_back(fmt::format("{:.4g}", d.at(q)));
    table.add(std::move(row));
  }
  if (!file.records().empty()) table.print(out);
}

void printRecords(const IlluminationFile& file, std::FILE* out) {
  Table table({"record", "position", "normal", "radius", "samples", "gain", "background", "comp."}, 3);
  for (std::size_t i = 0; i < file.records().size(); ++i) {
    const StoredIllumination& r = file.records()[i];
    table.add({std::to_string(i), vectorText(r.position), vectorText(r.normal), fmt::format("{:.4g}", r.radius),
               fmt::format("{:.0f}", r.samples), fmt::format("{:.2f}", file.likelihoodGain(r)),
               fmt::format("{:.3f}", r.background), std::to_string(r.count)});
  }
  table.print(out);
}

void writePoints(const IlluminationFile& file, const std::filesystem::path& out) {
  std::string text = "ply\nformat binary_little_endian 1.0\n";
  text += fmt::format("element vertex {}\n", file.records().size());
  for (const char* property :
       {"x", "y", "z", "nx", "ny", "nz", "radius", "samples", "background", "bsdf_fraction", "likelihood_gain"})
    text += fmt::format("property float {}\n", property);
  text += "end_header\n";
  for (const StoredIllumination& r : file.records()) {
    const std::array<float, 11> vertex{
        r.position[0], r.position[1], r.position[2], r.normal[0],    r.normal[1],           r.normal[2],
        r.radius,      r.samples,     r.background,  r.bsdfFraction, file.likelihoodGain(r)};
    text.append(reinterpret_cast<const char*>(vertex.data()), sizeof(vertex));
  }
  writeAtomically(out, text);
}

}  // namespace lobe
