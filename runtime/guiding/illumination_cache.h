#pragma once
// Trained illumination: records of the distribution of L cosθ over the hemisphere of points in the scene, and the
// look-up of the record that serves a point (Vorba et al. 2014, Section 5). Immutable, so that any number of threads
// can read it without locks.

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

/// A record as it is trained and stored: the density u · 2cosθ/π + (1−u) · Σ π_k N_k, with respect to the area of the
/// disc of the frame (tangent, normal × tangent, normal).
struct IlluminationRecord {
  Vec3 position;
  Vec3 normal;         ///< unit
  Vec3 tangent;        ///< unit, orthogonal to normal
  float radius;        ///< world units; the record serves points within this distance
  float background;    ///< u in [0,1]
  float irradiance;    ///< ∫ L cosθ dω of all light, in one unit for all records; 0 if not known
  float samples;       ///< number of particles seen in training
  float bsdfFraction;  ///< BSDF sampling fraction of the product, see BsdfSamplingFraction
  /// The mean log-likelihood of the particles of the last pass, before the record learnt from them, less that of
  /// cosine-weighted sampling (nats); 0 if not known.
  float likelihoodGain = 0;
  std::int32_t count = 0;
  std::array<Gaussian, kMaxLightComponents> components;  ///< weights sum to 1

  std::span<const Gaussian> gaussians() const { return {components.data(), static_cast<std::size_t>(count)}; }
};

/// The part of a record that sampling needs: a header, followed in memory by the Gaussians (SoA).
struct alignas(32) PackedRecord {
  std::array<float, 3> tangentXyz;  // no Vec3, so that the record is trivially copyable
  float background;
  float irradiance;
  float samples;
  float bsdfFraction;
  std::uint32_t count : 4;   ///< Gaussians
  std::uint32_t index : 28;  ///< index of the record in its cache, in the order given to the constructor

  Vec3 tangent() const { return {tangentXyz[0], tangentXyz[1], tangentXyz[2]}; }
  static constexpr int strideFor(int count) {
    return count <= kPaddingMultiple ? kPaddingMultiple : kMaxLightComponents;
  }
  GaussiansView gaussians() const {
    const int number = static_cast<int>(count);
    return {reinterpret_cast<const float*>(this + 1), strideFor(number), number};
  }
  /// Size of the header and the Gaussians.
  static constexpr std::size_t bytesFor(int count) {
    return sizeof(float) * (8 + kGaussianFields * static_cast<std::size_t>(strideFor(count)));
  }
};

/// A copy of a record with its Gaussians, independent of the lifetime of its cache.
class RecordCopy {
 public:
  void assign(const PackedRecord& record) {
    // With constant sizes, memcpy is expanded inline.
    if (record.count <= kPaddingMultiple)
      std::memcpy(memory_.data(), &record, PackedRecord::bytesFor(kPaddingMultiple));
    else
      std::memcpy(memory_.data(), &record, PackedRecord::bytesFor(kMaxLightComponents));
  }
  /// Valid after assign.
  const PackedRecord& operator*() const { return *reinterpret_cast<const PackedRecord*>(memory_.data()); }
  const PackedRecord* operator->() const { return &**this; }

 private:
  static_assert(sizeof(PackedRecord) == 8 * sizeof(float) && std::is_trivially_copyable_v<PackedRecord>);
  alignas(PackedRecord) std::array<std::byte, PackedRecord::bytesFor(kMaxLightComponents)> memory_;
};

class IlluminationCache {
 public:
  IlluminationCache() = default;
  /// unit: the largest radius of a record in world units (see TrainingOptions), > 0.
  IlluminationCache(const std::vector<IlluminationRecord>& records, float unit);

  /// Of the records whose radius contains x and whose normal is within about 14° of n, the one with the smallest cost
  /// |x−x_j|/unit + 2 sqrt(1.001 − n·n_j); nullptr if there is none. n: unit geometric normal on the side of interest.
  const PackedRecord* find(const Vec3& x, const Vec3& n) const;

  std::size_t size() const { return places_.size(); }
  /// A record of this cache, bit for bit as given to the constructor.
  IlluminationRecord unpacked(const PackedRecord& record) const;
  /// All records, as given to the constructor.
  std::vector<IlluminationRecord> records() const;
  float unit() const { return unit_; }
  std::size_t bytes() const;
  double meanComponents() const;  ///< per record; 0 if there are no records

 private:
  // The fields that find reads, copied in the order of cells so that the entries of a cell are contiguous.
  struct alignas(32) Entry {
    Vec3 position;
    Vec3 normal;
    float radius2;
    std::uint32_t block;  // first block of its record
  };
  struct Cell {
    std::uint64_t key;
    std::uint32_t begin, end;
  };
  // The fields needed only to build the look-up and to unpack records.
  struct Place {
    Vec3 position;
    Vec3 normal;
    float radius;
    float likelihoodGain;
    std::uint32_t block;
  };
  struct alignas(32) Block {
    std::array<float, 8> floats;
  };
  struct Placement {
    std::uint64_t key;  // cell and side
    std::uint32_t record;
  };
  /// Writes the record to its blocks; its place must be known.
  void pack(const IlluminationRecord& record, std::size_t index);
  /// Visits the key of each cell that the record's radius overlaps, for each side that it may serve.
  template <class Visit>
  void forEachKey(const Place& record, const Visit& visit) const;
  /// Places every record into its cells. Sorted by key, then by record.
  std::vector<Placement> placeInCells() const;
  const PackedRecord& at(std::uint32_t block) const { return reinterpret_cast<const PackedRecord&>(blocks_[block]); }
  const Cell* findCell(std::uint64_t key) const;

  std::vector<Place> places_;  // sorted by block
  std::vector<Block> blocks_;  // the packed records, each of one or more blocks
  float unit_ = 1;
  float inverseCellSize_ = 1;
  std::vector<Entry> entries_;
  std::vector<Cell> table_;  // hash table with open addressing; size: a power of two; begin == end marks a free slot
};

/// The cache with each mixture merged by `reduce` up to this threshold, ≥ 0. A record of up to four components takes
/// about half the memory.
IlluminationCache reduced(const IlluminationCache& cache, float threshold);

}  // namespace lobe
