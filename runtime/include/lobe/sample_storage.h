#pragma once
// The training samples of one pass: collected per thread, merged, and passed to Field::update.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "lobe/types.h"

namespace lobe {

struct SampleStorageData;
struct ShadingPoint;

/// Holds particles, requests for records and samples for the BSDF sampling fraction. Not thread-safe: use one storage
/// per thread and merge them. Field::update sorts the samples by the index of their path, so that the result does not
/// depend on which thread traced which path. After a move, a storage may only be assigned to or destroyed.
class SampleStorage {
 public:
  SampleStorage();
  ~SampleStorage();
  SampleStorage(SampleStorage&&) noexcept;
  SampleStorage& operator=(SampleStorage&&) noexcept;

  /// Begins a path; all samples added afterwards belong to it. Must be called before the first sample is added. Indices
  /// must be unique among all storages that are merged.
  void beginPath(std::uint64_t index);

  /// Adds a photon that arrived at a surface, in world space. Drops it if a vector is not finite, or if weight or
  /// flux is negative or not finite.
  ///
  /// normal: unit geometric normal on the side where the photon arrived.
  /// direction: unit, from the surface to where the photon came from.
  /// weight: flux (luminance), ≥ 0, without the part that next-event estimation handles better.
  /// distance: world units travelled since the last vertex, > 0; +infinity for light from the environment, as which
  /// other values count.
  /// flux: total flux (luminance), ≥ 0, before subtracting the part handled by next-event estimation. The irradiance of
  /// records is estimated from it: divide it by the number of photons of the pass, so that all passes use the same
  /// unit.
  void addPhoton(const Float3& position, const Float3& normal, const Float3& direction, float weight, float distance,
                 float flux);

  /// Requests a record at a point that no record serves (see SurfaceDistribution::hasRecord), on the side of wo.
  void requestRecord(const ShadingPoint& point);
  /// The same for a point in world space. normal: geometric normal on the side of the path, which is the other side
  /// than that of ShadingPoint::normal if ShadingPoint::wo.z < 0. It is normalised; requests without a direction are
  /// dropped.
  void requestRecord(const Float3& position, const Float3& normal);

  /// Appends the content of another storage and leaves that one empty. Does nothing if it is this storage.
  void merge(SampleStorage&& other);
  /// Appends the contents of other storages in their order, in parallel, and leaves those empty. This storage may be
  /// one of them: it keeps its content, and the others are appended. Like the functions of Field, uses oneTBB in the
  /// task arena of the calling thread. After an exception, all of them are empty.
  void merge(std::span<SampleStorage> others);

  /// Number of particles, from photons and camera paths.
  std::size_t particles() const;
  /// Removes all content.
  void clear();

 private:
  friend class Field;
  friend const SampleStorageData& dataOf(const SampleStorage& storage);
  friend class PathRecorder;
  std::unique_ptr<SampleStorageData> data_;
};

}  // namespace lobe
