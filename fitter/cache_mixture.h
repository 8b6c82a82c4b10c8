#pragma once
// Conversion between CacheComponent (the file format) and Gaussian (the mixture code), which have the same layout.

#include <cstddef>
#include <span>

#include "runtime/mixture/gaussian.h"
#include "schema/lobe_cache.h"

namespace lobe {

static_assert(sizeof(CacheComponent) == sizeof(Gaussian) && alignof(CacheComponent) == alignof(Gaussian));
static_assert(offsetof(CacheComponent, weight) == offsetof(Gaussian, weight));
static_assert(offsetof(CacheComponent, meanX) == offsetof(Gaussian, meanX));
static_assert(offsetof(CacheComponent, meanY) == offsetof(Gaussian, meanY));
static_assert(offsetof(CacheComponent, covXX) == offsetof(Gaussian, cov) + offsetof(Covariance, xx));
static_assert(offsetof(CacheComponent, covXY) == offsetof(Gaussian, cov) + offsetof(Covariance, xy));
static_assert(offsetof(CacheComponent, covYY) == offsetof(Gaussian, cov) + offsetof(Covariance, yy));

inline std::span<const Gaussian> asGaussians(std::span<const CacheComponent> components) {
  return {reinterpret_cast<const Gaussian*>(components.data()), components.size()};
}

inline CacheComponent asComponent(const Gaussian& g) {
  return {g.weight, g.meanX, g.meanY, g.cov.xx, g.cov.xy, g.cov.yy};
}

}  // namespace lobe
