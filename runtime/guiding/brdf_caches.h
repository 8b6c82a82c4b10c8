#pragma once
// The BRDF caches of a scene: read once, then looked up at every path vertex. This is the content of LobeCacheSet.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "lobe/cache_set.h"
#include "runtime/guiding/reflectance.h"
#include "runtime/mixture/grid.h"
#include "runtime/mixture/soa_gaussians.h"
#include "schema/lobe_cache.h"

namespace lobe {

class BrdfCaches {
 public:
  /// See LobeCacheSet.
  BrdfCaches(const std::filesystem::path& folder, std::span<const LobeRequest> requests, const std::string& remedy,
             float reduction = 0);

  /// Adds tint · ρ_lobe(wo, ·) to a reflectance. lobe: index of the request; throws std::out_of_range if there is none.
  /// wo: unit, z > 0, in the shading frame. turn: (cos, sin) of the rotation that maps shading-frame coordinates to the
  /// frame of the reflectance. A lobe whose record has no components, or for whose components there is no room, is
  /// counted in unrepresentableAlbedo instead.
  void add(int lobe, const Vec3& wo, const Vec2& turn, float tint, Reflectance& reflectance) const;

  std::size_t files() const { return caches_.size(); }
  std::size_t bytes() const;
  double meanComponents() const;  ///< per record; 0 if there are no records
  /// Content hashes of the files, in the order in which the requests first use them.
  std::vector<std::uint64_t> hashes() const;

 private:
  /// A record in memory.
  struct Record {
    Vec2 reference;     ///< the direction wo that it was fitted for, on the disc
    std::size_t first;  ///< index of its first float in Entry::lanes
    int stride, count;
    float integral;  ///< factor of the normalised mixture: ∫ ρ dω divided by the mass of the mixture inside the disc
    float albedo, cosineMass;

    /// Its components, given Entry::lanes.
    GaussiansView view(const std::vector<float>& lanes) const { return {lanes.data() + first, stride, count}; }
  };
  class Entry {
   public:
    Entry(LobeCache opened, float reduction);
    /// The record for the grid direction nearest to wo. wo must be mirrored first if the grid covers only a quarter of
    /// the directions.
    const Record& nearest(const Vec3& wo) const;

    LobeCache cache;
    DirectionGrid grid;
    std::vector<Record> records;
    std::vector<float> lanes;  ///< the Gaussians of all records (SoA)
    /// For elevation grids only: the decreasing cosines at which the look-up moves on to the next of recordOfStep.
    /// There are few of them, so that counting those above a cosine is faster than DirectionGrid::nearest.
    std::vector<float> steps;
    std::vector<std::uint32_t> recordOfStep;

   private:
    void findSteps();
  };
  std::vector<Entry> caches_;
  std::vector<int> cacheOfRequest_;
};

}  // namespace lobe
