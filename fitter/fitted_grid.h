#pragma once
// The fit of a lobe over a grid of directions, in the form of a cache.

#include <vector>

#include "fitter/lobe_fit.h"
#include "schema/lobe_cache.h"

namespace lobe {

struct FittedGrid {
  std::vector<CacheRecord> records;
  std::vector<CacheComponent> components;
  std::vector<CacheLookup> lookup;  ///< of every entry of the grid

  void append(const FittedRecord& fitted, std::uint32_t entry);
};

}  // namespace lobe
