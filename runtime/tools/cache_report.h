#pragma once
// What lobefit and lobedump say of a cache, for people and for machines.

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "schema/lobe_cache.h"

namespace lobe {

/// Whether a record has a mixture that was graded; others are left to the BSDF's sampling.
inline bool graded(const CacheRecord& record) {
  return record.count > 0;
}

/// Over the records of a cache; from the NEV on, over those graded.
struct CacheSummary {
  std::size_t records = 0;
  bool graded = false;  ///< some record is; else the numbers from the NEV on mean nothing and are 0
  double meanComponents = 0;
  double nevMedian = 0, nevWorst = 0;            ///< drawn from the graded density
  double coverageMedian = 0, coverageWorst = 0;  ///< the same quantity drawn from the lobe's own sampler
  double worstRatio = 0;                         ///< largest f/p of all records
  double outside = 0;                            ///< mean share of the mixtures outside the disc
  std::size_t bytes = 0;                         ///< of the file
};
CacheSummary summarise(const LobeCache& cache);

/// One row of the table.
struct CacheReport {
  std::filesystem::path path;
  std::string lobe;                    ///< for people
  std::vector<std::string> materials;  ///< empty: not known
  CacheSummary summary;
  bool upToDate = false;  ///< was not fitted in this run
  double seconds = 0;     ///< of the fit
};

/// As aligned columns; without materials and seconds when showRun is false.
void printReports(const std::vector<CacheReport>& reports, bool showRun, std::FILE* out);

nlohmann::ordered_json toJson(const CacheSummary& summary);
nlohmann::ordered_json toJson(const CacheReport& report);

/// Everything a cache holds: header, settings, grid, summary, and every record with its direction and components.
nlohmann::ordered_json toJson(const LobeCache& cache, const std::filesystem::path& path);

/// The header of a cache as lines of text.
void printHeader(const LobeCache& cache, const std::filesystem::path& path, std::FILE* out);

/// A row for every record; a dash where it is left to the BSDF.
void printRecords(const LobeCache& cache, std::FILE* out);

/// A number of a record: null, or a dash, where it is not graded.
nlohmann::ordered_json gradeJson(const CacheRecord& record, float value);
std::string gradeText(const CacheRecord& record, const std::string& text);

/// The number of components, or "BSDF".
std::string componentsText(const CacheRecord& record);

nlohmann::ordered_json componentJson(const CacheComponent& component);

/// A float as the shortest decimal that reads back the same, not as the double it converts to.
nlohmann::ordered_json shortNumber(float value);

/// "KettleGreen + 21 more"
std::string abbreviated(const std::vector<std::string>& names);

}  // namespace lobe
