#include "fitter/fitted_grid.h"

#include "fitter/cache_mixture.h"
#include "runtime/mixture/lookup.h"

namespace lobe {

void FittedGrid::append(const FittedRecord& fitted, std::uint32_t entry) {
  CacheRecord record = fitted.record;
  record.entry = entry;
  record.first = static_cast<std::uint32_t>(components.size());
  records.push_back(record);
  for (const Gaussian& g : fitted.mixture) components.push_back(asComponent(g));
}

std::span<Gaussian> FittedGrid::mixtureFor(const DirectionGrid& grid, const Vec3& wo, std::span<Gaussian> room) const {
  const Mirror mirror = quarter ? Mirror::intoQuadrant(wo) : Mirror{};
  const CacheRecord& record = records[lookup[static_cast<std::size_t>(grid.nearest(mirror(wo)))]];
  const Vec2 reference = toDisc(grid.direction(static_cast<int>(record.entry)));
  const auto fitted = asGaussians(components).subspan(record.first, record.count);
  return alignMixture({grid.kind, reference, mirror}, fitted, wo, room);
}

}  // namespace lobe
