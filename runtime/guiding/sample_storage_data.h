#pragma once
// The content of a SampleStorage.

#include <cstdint>
#include <vector>

#include "lobe/sample_storage.h"
#include "runtime/guiding/bsdf_sampling_fraction.h"
#include "runtime/guiding/particle.h"

namespace lobe {

struct SampleStorageData {
  std::vector<Particle> photons;          ///< of photons, of a density in flux per area
  std::vector<Particle> samples;          ///< of camera paths
  std::vector<FractionSample> fractions;  ///< of camera paths, for the BSDF sampling fraction
  std::vector<RecordRequest> requests;

  /// Where the samples of a path begin in each of the lists; they end where the next path's begin.
  struct Path {
    std::uint64_t index;
    std::size_t photons, samples, fractions, requests;
  };
  std::vector<Path> paths;

  void beginPath(std::uint64_t index) {
    paths.push_back({index, photons.size(), samples.size(), fractions.size(), requests.size()});
  }
  void append(const SampleStorageData& other);
  /// The same with its paths in the order of their indices.
  SampleStorageData inOrder() const;
  bool isInOrder() const;
};

/// The content of a storage.
const SampleStorageData& dataOf(const SampleStorage& storage);

}  // namespace lobe
