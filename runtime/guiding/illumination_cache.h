#pragma once
// Trained illumination: records of L cosθ over the hemisphere of points in the scene, and the look-up of the record
// that serves a point (Vorba et al. 2014, Section 5). Frozen: read by any number of threads without locks.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/soa_gaussians.h"

namespace lobe {

/// u · 2cosθ/π + (1−u) · Σ π_k N_k over the disc of the frame (tangent, normal × tangent, normal). The plain form, in
/// which records are made and stored.
struct IlluminationRecord {
  Vec3 position;
  Vec3 normal;         ///< unit
  Vec3 tangent;        ///< unit, orthogonal to normal
  float radius;        ///< world units, the record serves points within
  float background;    ///< u in [0,1]
  float irradiance;    ///< ∫ L cosθ, from all light, in units that are the same for all records; 0: not known
  float samples;       ///< particles seen in training
  float bsdfFraction;  ///< of the BSDF in the product's density, see BsdfSamplingFraction
  std::int32_t count = 0;
  std::array<Gaussian, kMaxLightComponents> components;  ///< weights sum to 1

  std::span<const Gaussian> gaussians() const { return {components.data(), static_cast<std::size_t>(count)}; }
};

/// What sampling needs of a record: a header that its Gaussians follow in memory.
struct alignas(32) PackedRecord {
  Vec3 tangent;
  float background;
  float irradiance;
  float samples;
  float bsdfFraction;
  std::uint32_t count : 4;   ///< Gaussians
  std::uint32_t index : 28;  ///< of the record in its cache, in the order that records were given in

  static constexpr int strideFor(int count) {
    return count <= kPaddingMultiple ? kPaddingMultiple : kMaxLightComponents;
  }
  GaussiansView gaussians() const {
    const int number = static_cast<int>(count);
    return {reinterpret_cast<const float*>(this + 1), strideFor(number), number};
  }
  /// Of the header and the Gaussians of a record.
  static constexpr std::size_t bytesFor(int count) {
    return sizeof(float) * (8 + kGaussianFields * static_cast<std::size_t>(strideFor(count)));
  }
};

/// A copy of a record with its Gaussians, which does not depend on the cache that it came from.
class RecordCopy {
 public:
  void assign(const PackedRecord& record) {
    // Sizes that are constants, for which no function is called.
    if (record.count <= kPaddingMultiple)
      std::memcpy(memory_.data(), &record, PackedRecord::bytesFor(kPaddingMultiple));
    else
      std::memcpy(memory_.data(), &record, PackedRecord::bytesFor(kMaxLightComponents));
  }
  /// After assign.
  const PackedRecord& operator*() const { return *reinterpret_cast<const PackedRecord*>(memory_.data()); }
  const PackedRecord* operator->() const { return &**this; }

 private:
  static_assert(sizeof(PackedRecord) == 8 * sizeof(float));
  alignas(PackedRecord) std::array<std::byte, PackedRecord::bytesFor(kMaxLightComponents)> memory_;
};

class IlluminationCache {
 public:
  IlluminationCache() = default;
  /// unit: the length that radii are clamped to (see TrainingOptions), > 0.
  IlluminationCache(const std::vector<IlluminationRecord>& records, float unit);

  /// The valid record of least |x−x_j|/unit + 2 sqrt(1.001 − n·n_j): within its radius and about 14° of its normal. n
  /// is the unit geometric normal on the side asked for. nullptr: none, the BSDF is to be sampled.
  const PackedRecord* find(const Vec3& x, const Vec3& n) const;

  std::size_t size() const { return places_.size(); }
  /// A record of this cache as it was given, to the bit.
  IlluminationRecord unpacked(const PackedRecord& record) const;
  /// All records as they were given.
  std::vector<IlluminationRecord> records() const;
  float unit() const { return unit_; }
  std::size_t bytes() const;
  double meanComponents() const;  ///< of a record; 0 without records

 private:
  // What find looks at, copied into cell order so that a cell is one run of memory.
  struct alignas(32) Entry {
    Vec3 position;
    Vec3 normal;
    float radius2;
    std::uint32_t block;  // where its record begins
  };
  struct Cell {
    std::uint64_t key;
    std::uint32_t begin, end;
  };
  // What only the look-up's making and unpacking need.
  struct Place {
    Vec3 position;
    Vec3 normal;
    float radius;
    std::uint32_t block;
  };
  struct alignas(32) Block {
    std::array<float, 8> floats;
  };
  struct Placement {
    std::uint64_t key;  // of the cell and side
    std::uint32_t record;
  };
  void pack(const IlluminationRecord& record);
  /// Every record in every cell that it reaches into, on every side that it may be asked for, ordered by both.
  std::vector<Placement> placeInCells() const;
  const PackedRecord& at(std::uint32_t block) const { return reinterpret_cast<const PackedRecord&>(blocks_[block]); }
  const Cell* findCell(std::uint64_t key) const;

  std::vector<Place> places_;  // ordered by block
  std::vector<Block> blocks_;  // records, each of as many blocks as it needs
  float unit_ = 1;
  float inverseCellSize_ = 1;
  std::vector<Entry> entries_;
  std::vector<Cell> table_;  // open addressing, a power of two; begin == end marks a free slot
};

/// The cache with its mixtures merged by `reduce` at this threshold of cost, ≥ 0. Records of four components or fewer
/// take half the memory.
IlluminationCache reduced(const IlluminationCache& cache, float threshold);

}  // namespace lobe
