#pragma once
// The product as Herholz et al. 2016 form it: mean, covariance and weight of every pair of components, and a density
// that is the sum over all of them. What the lazy form is timed against. With kernels as ours, in lanes of 4 or 8.

#include <array>

#include "runtime/mixture/product.h"

namespace lobe {

class AllPairs {
 public:
  static constexpr int kMostPairs = 64;

  /// Factors as Product takes them, of at most kMostPairs pairs; the light's stride is a multiple of lanes (4 or 8).
  AllPairs(const GaussiansView& reflectance, const GaussiansView& light, int lanes);

  Vec2 sample(float choice, const Vec2& u) const;
  float pdf(const Vec2& y) const;

 private:
  int lanes_;
  float mass_;
  int count_;
  alignas(64) std::array<float, std::size_t{kGaussianFields} * kMostPairs> pairs_;  // as GaussiansView has them
};

}  // namespace lobe
