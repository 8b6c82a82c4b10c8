#pragma once
// The content of a Field, for the parts of the library and the tools that look inside.

#include <optional>

#include "lobe/field.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/illumination_trainer.h"

namespace lobe {

struct FieldData {
  std::optional<IlluminationTrainer> trainer;  ///< nullopt: frozen, and
  IlluminationCache frozen;

  const IlluminationCache& cache() const { return trainer ? trainer->cache() : frozen; }
};

/// The records of a field.
const IlluminationCache& cacheOf(const Field& field);
/// A field of these records, not to be trained.
Field fieldOf(IlluminationCache cache);

}  // namespace lobe
