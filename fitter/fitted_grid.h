#pragma once
// A lobe fitted over a grid of directions, laid out as in a cache file.

#include <span>
#include <vector>

#include "fitter/lobe_fit.h"
#include "runtime/mixture/grid.h"
#include "schema/lobe_cache.h"

namespace lobe {

struct FittedGrid {
  std::vector<CacheRecord> records;
  std::vector<CacheComponent> components;
  std::vector<std::uint32_t> lookup;  ///< the record of every grid entry
  bool quarter = false;               ///< see LobeCacheInfo

  /// The mixture that a cache look-up returns for wo. It is written to the front of room, which must hold
  /// kMaxCacheComponents Gaussians; returns the part that was written.
  std::span<Gaussian> mixtureFor(const DirectionGrid& grid, const Vec3& wo, std::span<Gaussian> room) const;

  void append(const FittedRecord& fitted, std::uint32_t entry);
};

}  // namespace lobe
