#pragma once
// Comparison of two BRDF caches, for lobedump --diff.

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "schema/lobe_cache.h"

namespace lobe {

/// A header field that differs, with the name that it has in lobedump --json.
struct FieldDifference {
  std::string name, a, b;
};

/// Indices of a record of A and of the record of B that serves its direction.
struct RecordPair {
  int a, b;
  bool same;  ///< whether all fields and components are equal
};

struct CacheDifference {
  bool equal = false;     ///< whether the contents are equal byte for byte
  bool sameLobe = false;  ///< whether the keys are equal
  bool sameGrid = false;
  std::vector<FieldDifference> fields;  ///< the fields that differ
  std::vector<RecordPair> records;      ///< one pair for every record of A
  /// Numbers of pairs in which 1 + NEV of B is lower, higher, or equal (within 0.1 %). A pair is not counted if one of
  /// its records has no mixture.
  int better = 0, worse = 0, alike = 0;
};

CacheDifference compareCaches(const LobeCache& a, const LobeCache& b);

/// Two caches and their paths.
struct CachePair {
  const LobeCache& a;
  const LobeCache& b;
  std::filesystem::path pathA, pathB;
};

/// Prints the fields that differ, a row for every pair of different records, and summaries; one line if the caches are
/// equal.
void printDifference(const CacheDifference& difference, const CachePair& caches, std::FILE* out);

/// The same as JSON, with all pairs of records.
nlohmann::ordered_json toJson(const CacheDifference& difference, const CachePair& caches);

}  // namespace lobe
