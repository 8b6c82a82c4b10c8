#include "fitter/fitted_grid.h"

#include "fitter/cache_mixture.h"

namespace lobe {

void FittedGrid::append(const FittedRecord& fitted, std::uint32_t entry) {
  CacheRecord record = fitted.record;
  record.entry = entry;
  record.first = static_cast<std::uint32_t>(components.size());
  records.push_back(record);
  for (const Gaussian& g : fitted.mixture) components.push_back(asComponent(g));
}

}  // namespace lobe
