#pragma once
// The eager product of Herholz et al. 2016: mean, covariance and weight of every pair of components, and a density that
// is the sum over all pairs. Baseline for the lazy product (runtime/mixture/product.h), with kernels of the same kind,
// for 4 or 8 SIMD lanes.

#include <array>

#include "runtime/mixture/product.h"

namespace lobe {

class EagerProduct {
 public:
  static constexpr int kMostPairs = 64;

  /// Factors as for Product, with up to kMostPairs pairs; the stride of the light is a multiple of lanes (4 or 8).
  EagerProduct(const GaussiansView& reflectance, const GaussiansView& light, int lanes);

  Vec2 sample(float choice, const Vec2& u) const;
  float pdf(const Vec2& y) const;

 private:
  int lanes_;
  float mass_;
  int count_;
  alignas(64) std::array<float, std::size_t{kGaussianFields} * kMostPairs> pairs_;  // in the layout of GaussiansView
};

}  // namespace lobe
