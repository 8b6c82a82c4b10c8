#pragma once
// Trained illumination: records of L cosθ over the hemisphere of points in the scene, and the look-up of the record
// that serves a point (Vorba et al. 2014, Section 5). Frozen: read by any number of threads without locks.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/product.h"

namespace lobe {

/// u · 2cosθ/π + (1−u) · Σ π_k N_k over the disc of the frame (tangent, normal × tangent, normal).
struct IlluminationRecord {
  Vec3 position;
  Vec3 normal;       ///< unit
  Vec3 tangent;      ///< unit, orthogonal to normal
  float radius;      ///< world units, the record serves points within
  float background;  ///< u in [0,1]
  float irradiance;  ///< ∫ L cosθ, from all light, in units that are the same for all records; 0: not known
  float samples;     ///< particles seen in training
  std::int32_t count = 0;
  std::array<Gaussian, kMaxIlluminationComponents / 2> components;  ///< weights sum to 1

  std::span<const Gaussian> gaussians() const { return {components.data(), static_cast<std::size_t>(count)}; }
};

class IlluminationCache {
 public:
  IlluminationCache() = default;
  /// unit: the length that radii are clamped to (see TrainingOptions), > 0.
  IlluminationCache(std::vector<IlluminationRecord> records, float unit);

  /// The valid record of least |x−x_j|/unit + 2 sqrt(1.001 − n·n_j): within its radius and about 41° of its normal. n
  /// is the unit geometric normal on the side asked for. nullptr: none, the BSDF is to be sampled.
  const IlluminationRecord* find(const Vec3& x, const Vec3& n) const;

  std::span<const IlluminationRecord> records() const { return records_; }
  std::size_t bytes() const;

 private:
  // What find looks at, copied into cell order so that a cell is one run of memory.
  struct Entry {
    Vec3 position;
    Vec3 normal;
    float radius2;
    std::uint32_t record;
  };
  struct Cell {
    std::uint64_t key;
    std::uint32_t begin, end;
  };
  std::uint64_t cellKey(const Eigen::Vector3i& cell) const;
  const Cell* findCell(std::uint64_t key) const;

  std::vector<IlluminationRecord> records_;
  float unit_ = 1;
  float inverseCellSize_ = 1;
  std::vector<Entry> entries_;
  std::vector<Cell> table_;  // open addressing, a power of two; begin == end marks a free slot
};

}  // namespace lobe
