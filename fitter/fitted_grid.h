#pragma once
// The fit of a lobe over a grid of directions, in the form of a cache.

#include <span>
#include <vector>

#include "fitter/lobe_fit.h"
#include "runtime/mixture/grid.h"
#include "schema/lobe_cache.h"

namespace lobe {

struct FittedGrid {
  std::vector<CacheRecord> records;
  std::vector<CacheComponent> components;
  std::vector<std::uint32_t> lookup;  ///< of every entry of the grid, the record
  bool quarter = false;               ///< see LobeCacheInfo

  /// What a look-up for wo finds: writes to the front of room, which holds kMaxCacheComponents, and returns that.
  std::span<Gaussian> mixtureFor(const DirectionGrid& grid, const Vec3& wo, std::span<Gaussian> room) const;

  void append(const FittedRecord& fitted, std::uint32_t entry);
};

}  // namespace lobe
