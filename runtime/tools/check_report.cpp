#include "runtime/tools/check_report.h"

#include <numeric>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "runtime/tools/json_text.h"

namespace lobe {
namespace {

nlohmann::ordered_json asJson(const Fault& fault) {
  nlohmann::ordered_json json{{"where", fault.where}, {"message", fault.message}, {"count", fault.count}};
  json["with_lenient"] =
      fault.consequence.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(fault.consequence);
  return json;
}

void printJson(const std::filesystem::path& scene, const SceneCheck& check, std::FILE* out) {
  nlohmann::ordered_json faults = nlohmann::ordered_json::array();
  for (const Fault& fault : check.faults) faults.push_back(asJson(fault));
  const nlohmann::ordered_json json{{"scene", scene.string()},
                                    {"readable", check.readable},
                                    {"faults", faults},
                                    {"warnings", check.warnings},
                                    {"notes", check.notes}};
  fmt::print(out, "{}\n", jsonText(json));
}

void printLines(const std::filesystem::path& scene, const SceneCheck& check, std::FILE* out) {
  for (const Fault& fault : check.faults) fmt::print(out, "fault: {}\n", fault.text());
  for (const std::string& warning : check.warnings) fmt::print(out, "warning: {}\n", warning);
  for (const std::string& note : check.notes) fmt::print(out, "note: {}\n", note);
  if (check.readable) fmt::print(out, "{} can be read\n", scene.string());
}

}  // namespace

void reportCheck(const std::filesystem::path& scene, const ReadOptions& options, bool json, std::FILE* out) {
  const SceneCheck check = checkScene(scene, options);
  if (json)
    printJson(scene, check, out);
  else
    printLines(scene, check, out);
  if (check.readable) return;
  const auto count = std::accumulate(check.faults.begin(), check.faults.end(), std::size_t{0},
                                     [](std::size_t sum, const Fault& fault) { return sum + fault.count; });
  throw std::runtime_error(fmt::format("{}: {} fault{}", scene.string(), count, count == 1 ? "" : "s"));
}

}  // namespace lobe
