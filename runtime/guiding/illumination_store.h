#pragma once
// Trained illumination to and from its file.

#include <cstddef>
#include <vector>

#include "runtime/guiding/illumination_cache.h"
#include "schema/illumination_file.h"

namespace lobe {

/// The bytes of a file that holds the cache; info.unit is the cache's, whatever it was. The same cache and info give
/// the same bytes.
std::vector<std::byte> storeIllumination(const IlluminationCache& cache, IlluminationInfo info);

/// The cache that was stored, to the bit; its look-up is built anew.
IlluminationCache loadIllumination(const IlluminationFile& file);

}  // namespace lobe
