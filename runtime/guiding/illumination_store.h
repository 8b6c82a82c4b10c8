#pragma once
// Conversion of trained illumination to and from its file format.

#include <cstddef>
#include <vector>

#include "runtime/guiding/illumination_cache.h"
#include "schema/illumination_file.h"

namespace lobe {

/// The bytes of a file that holds the cache; info.unit is replaced by the cache's. Equal input gives equal bytes.
std::vector<std::byte> storeIllumination(const IlluminationCache& cache, IlluminationInfo info);

/// The cache that was stored, with bit-identical records; its look-up structure is rebuilt.
IlluminationCache loadIllumination(const IlluminationFile& file);

}  // namespace lobe
