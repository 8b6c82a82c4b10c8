#pragma once
// What differs between two caches.

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "schema/lobe_cache.h"

namespace lobe {

/// Something that the headers say, by the name that lobedump --json gives it.
struct FieldDifference {
  std::string name, a, b;
};

/// A record of A and the one of B for the same direction, by index; on other grids, the one of B that is nearest.
struct RecordPair {
  int a, b;
  bool same;  ///< all numbers and components are
};

struct CacheDifference {
  bool equal = false;     ///< the same content, byte for byte
  bool sameLobe = false;  ///< the keys are equal
  bool sameGrid = false;
  std::vector<FieldDifference> fields;  ///< those that differ
  std::vector<RecordPair> records;      ///< a pair for every record of A
  /// Records of A whose partner needs fewer samples, more, or as many: 1 + NEV, equal within a thousandth.
  /// None of them where a record is left to the BSDF.
  int better = 0, worse = 0, alike = 0;
};

CacheDifference compareCaches(const LobeCache& a, const LobeCache& b);

/// Two caches and where they were found.
struct CachePair {
  const LobeCache& a;
  const LobeCache& b;
  std::filesystem::path pathA, pathB;
};

/// For people: fields, a row for every record that differs, the sums. One line when the two are equal.
void printDifference(const CacheDifference& difference, const CachePair& caches, std::FILE* out);

/// The same, with every record.
nlohmann::ordered_json toJson(const CacheDifference& difference, const CachePair& caches);

}  // namespace lobe
