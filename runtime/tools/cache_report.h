#pragma once
// Reports on BRDF caches by lobefit and lobedump, as text and as JSON.

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "schema/lobe_cache.h"

namespace lobe {

/// Whether a record has a mixture, which was graded. Records without one are left to BSDF sampling.
inline bool graded(const CacheRecord& record) {
  return record.count > 0;
}

/// Statistics over all records of a cache; those from nevMedian to outside are over its graded records only.
struct CacheSummary {
  std::size_t records = 0;
  bool graded = false;  ///< whether any record is graded; otherwise the statistics from nevMedian to outside are 0
  double meanComponents = 0;
  double nevMedian = 0, nevWorst = 0;            ///< relative variance (NEV), with samples of the graded density
  double coverageMedian = 0, coverageWorst = 0;  ///< the same, with samples of the lobe's sampler
  double worstRatio = 0;                         ///< largest f/p of all records
  double outside = 0;                            ///< mean fraction of the mixtures outside the disc
  std::size_t bytes = 0;                         ///< size of the file
};
CacheSummary summarise(const LobeCache& cache);

/// One row of the table of caches.
struct CacheReport {
  std::filesystem::path path;
  std::string lobe;                    ///< description of the lobe
  std::vector<std::string> materials;  ///< empty if unknown
  CacheSummary summary;
  bool upToDate = false;  ///< whether the cache was up to date and not fitted in this run
  double seconds = 0;     ///< duration of the fit
};

/// Prints the reports as aligned columns. The columns of materials and seconds are shown only if showRun is true.
void printReports(const std::vector<CacheReport>& reports, bool showRun, std::FILE* out);

nlohmann::ordered_json toJson(const CacheSummary& summary);
nlohmann::ordered_json toJson(const CacheReport& report);

/// The whole content of a cache: header, settings, grid, summary, and every record with its direction and components.
nlohmann::ordered_json toJson(const LobeCache& cache, const std::filesystem::path& path);

/// Prints the header of a cache as text.
void printHeader(const LobeCache& cache, const std::filesystem::path& path, std::FILE* out);

/// Prints a row for every record, with dashes in place of the grades of a record without a mixture.
void printRecords(const LobeCache& cache, std::FILE* out);

/// A grade of a record; null, or a dash, if the record is not graded.
nlohmann::ordered_json gradeJson(const CacheRecord& record, float value);
std::string gradeText(const CacheRecord& record, const std::string& text);

/// The number of components, or "BSDF".
std::string componentsText(const CacheRecord& record);

nlohmann::ordered_json componentJson(const CacheComponent& component);

/// A float as the shortest decimal number that reads back as the same float.
nlohmann::ordered_json shortNumber(float value);

/// "KettleGreen + 21 more"
std::string abbreviated(const std::vector<std::string>& names);

}  // namespace lobe
