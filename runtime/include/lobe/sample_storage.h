#pragma once
// What paths tell about light, collected by threads and learnt from by a Field.

#include <cstddef>
#include <cstdint>
#include <memory>

#include "lobe/types.h"

namespace lobe {

struct SampleStorageData;

/// Particles, requests for records and samples of the BSDF sampling fraction. One for each thread; not safe to share
/// while it is written. Samples carry the index of the path that they belong to, and merging orders them by it, so that
/// what a field learns does not depend on which thread traced which path.
class SampleStorage {
 public:
  SampleStorage();
  ~SampleStorage();
  SampleStorage(SampleStorage&&) noexcept;
  SampleStorage& operator=(SampleStorage&&) noexcept;

  /// What follows belongs to this path. Each path is begun once, in one storage.
  void beginPath(std::uint64_t index);

  /// Light that a photon brought to a surface. normal: unit geometric normal on the side that it arrived at; direction:
  /// unit, from the surface to where it came from; weight: its flux that next-event estimation would not find better, ≥
  /// 0; distance: travelled since the last vertex, +infinity from the environment; flux: all of its flux.
  void addPhoton(const Float3& position, const Float3& normal, const Float3& direction, float weight, float distance,
                 float flux);

  /// Asks for a record at a point where there is none, see SurfaceDistribution::hasRecord.
  void requestRecord(const Float3& position, const Float3& normal);

  /// Takes over the paths of another storage, which is left empty.
  void merge(SampleStorage&& other);

  std::size_t particles() const;
  void clear();

 private:
  friend class Field;
  friend const SampleStorageData& dataOf(const SampleStorage& storage);
  friend class PathRecorder;
  std::unique_ptr<SampleStorageData> data_;
};

}  // namespace lobe
