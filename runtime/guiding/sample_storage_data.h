#pragma once
// The content of a SampleStorage.

#include <cstdint>
#include <span>
#include <vector>

#include "lobe/sample_storage.h"
#include "runtime/guiding/bsdf_sampling_fraction.h"
#include "runtime/guiding/particle.h"

namespace lobe {

struct SampleStorageData {
  std::vector<Particle> photons;          ///< from photons; their density is flux per area
  std::vector<Particle> samples;          ///< from camera paths
  std::vector<FractionSample> fractions;  ///< from camera paths, for the BSDF sampling fraction
  std::vector<RecordRequest> requests;

  /// The index of the first sample of a path in each of the lists; a path ends where the next one begins. Paths without
  /// samples need no entry.
  struct Path {
    std::uint64_t index;
    std::size_t photons, samples, fractions, requests;
  };
  std::vector<Path> paths;

  void beginPath(std::uint64_t index);
  /// Where a path that is begun next starts.
  Path end() const { return {0, photons.size(), samples.size(), fractions.size(), requests.size()}; }
  /// Appends the content of the others in their order, in parallel, and leaves them empty.
  void append(std::span<SampleStorageData* const> others);
  /// A copy with the paths sorted by index.
  SampleStorageData inOrder() const;
  bool isInOrder() const;
};

/// The content of a storage.
const SampleStorageData& dataOf(const SampleStorage& storage);

}  // namespace lobe
