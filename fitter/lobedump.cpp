// lobedump FILE.lobe...: shows what caches hold and how good they are.

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "fitter/report.h"
#include "scenes/tool.h"

namespace {

using namespace lobe;

struct Options {
  std::vector<std::string> files;
  bool records = false;
  bool json = false;
};

void declare(CLI::App& app, Options& o) {
  app.add_option("files", o.files, "Cache files")->required()->type_name("FILE.lobe")->default_str("");
  app.add_flag("--records", o.records, "Also print a row for every record");
  app.add_flag("--json", o.json, "Print everything, with all components, as JSON");
}

void printJson(const std::vector<LobeCache>& caches, const Options& o) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < caches.size(); ++i) json.push_back(toJson(caches[i], o.files[i]));
  fmt::print("{}\n", json.dump(2));
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

void run(const Options& o) {
  std::vector<LobeCache> caches;
  for (const std::string& file : o.files) caches.push_back(LobeCache::open(file));
  o.json ? printJson(caches, o) : printText(caches, o);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  return lobe::runTool(
      "lobedump", "Shows Gaussian-mixture caches: what they are and how good each record is.", argc, argv,
      [&](CLI::App& app) { declare(app, options); }, [&] { run(options); });
}
