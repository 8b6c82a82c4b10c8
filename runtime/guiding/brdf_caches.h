#pragma once
// The BRDF caches of a scene, opened once and looked up at every vertex.

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
  /// Opens the file of every request in the folder; equal keys share one. Throws std::runtime_error with one line that
  /// names all materials whose cache is missing, stale or damaged, and `remedy`, the command that makes them.
  /// Mixtures are merged by `reduce` at the threshold `reduction` of cost; 0 leaves them.
  BrdfCaches(const std::filesystem::path& folder, std::span<const LobeRequest> requests, const std::string& remedy,
             float reduction = 0);

  /// Adds tint · ρ_lobe at wo to a reflectance. lobe: index of the request. wo: unit, z > 0, in the shading frame.
  /// turn: (cos, sin) of the angle by which the reflectance's frame sees shading-frame vectors turned about the normal.
  /// A lobe without components, or whose components do not fit any more, is left to the BSDF's sampler.
  void add(int lobe, const Vec3& wo, const Vec2& turn, float tint, Reflectance& reflectance) const;

  std::size_t files() const { return caches_.size(); }
  std::size_t bytes() const;
  double meanComponents() const;  ///< of a record; 0 without records
  /// Content hashes of the files, in order of first use.
  std::vector<std::uint64_t> hashes() const;

 private:
  /// A record as it is looked up.
  struct Record {
    Vec2 reference;     ///< the direction that it was fitted for, on the disc
    std::size_t first;  ///< of its lanes
    int stride, count;
    float integral;  ///< over the plane: what the components' weights are to be multiplied by for ∫ ρ dω
    float albedo, cosineMass;

    /// The view of its components.
    GaussiansView view(const std::vector<float>& lanes) const { return {lanes.data() + first, stride, count}; }
  };
  class Entry {
   public:
    Entry(LobeCache opened, float reduction);
    /// The record of the grid's direction nearest to wo, which is mirrored where the grid is of a quarter.
    const Record& nearest(const Vec3& wo) const;

    LobeCache cache;
    DirectionGrid grid;
    std::vector<Record> records;
    std::vector<float> lanes;  ///< of all records
    /// Of grids of elevations: the cosines, falling, where the next of recordOfStep serves. They are few, so that to
    /// count those above a cosine takes less time than DirectionGrid::nearest.
    std::vector<float> steps;
    std::vector<std::uint32_t> recordOfStep;

   private:
    void findSteps();
  };
  std::vector<Entry> caches_;
  std::vector<int> cacheOfRequest_;
};

}  // namespace lobe
