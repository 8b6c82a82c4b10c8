#pragma once
// The content of a Field, for internal use by the library and its tools.

#include <optional>

#include "lobe/field.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/illumination_trainer.h"

namespace lobe {

struct FieldData {
  std::optional<IlluminationTrainer> trainer;  ///< nullopt if the field cannot be trained
  IlluminationCache frozen;                    ///< the records if there is no trainer

  const IlluminationCache& cache() const { return trainer ? trainer->cache() : frozen; }
};

/// The records of a field.
const IlluminationCache& cacheOf(const Field& field);
/// A field with these records that cannot be trained.
Field fieldOf(IlluminationCache cache);

}  // namespace lobe
