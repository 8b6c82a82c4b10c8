#pragma once
// Mixtures in the data layout of the kernels, for tests.

#include <vector>

#include <catch2/catch.hpp>

#include "runtime/mixture/packing.h"
#include "runtime/mixture/product.h"

namespace lobe {

/// A mixture packed as a structure of arrays.
class Packed {
 public:
  explicit Packed(const Mixture& mixture, int stride = GaussianStore<kMaxReflectanceComponents>::kStride)
      : count_(static_cast<int>(mixture.size())), stride_(stride) {
    data_.resize(static_cast<std::size_t>(stride) * kGaussianFields + kMaxVectorLanes);
    packGaussians(mixture, data_.data(), stride);
  }
  GaussiansView view() const { return {data_.data(), stride_, count_}; }

 private:
  std::vector<float> data_;
  int count_, stride_;
};

inline Packed packedLight(const Mixture& mixture) {
  REQUIRE(mixture.size() <= kMaxLightComponents);
  return Packed(mixture, mixture.size() <= kPaddingMultiple ? kPaddingMultiple : kMaxLightComponents);
}

/// A product that owns its factors.
struct OwnedProduct {
  OwnedProduct(const Mixture& one, float constant, const Mixture& two)
      : reflectance(one), light(packedLight(two)), product(reflectance.view(), constant, light.view()) {}
  OwnedProduct(const OwnedProduct&) = delete;
  float mass() const { return product.mass(); }
  float pdf(const Vec2& y) const { return product.pdf(y); }
  Vec2 sample(float choice, const Vec2& u) const { return product.sample(choice, u); }

  Packed reflectance, light;
  Product product;
};

/// Calls check with every instruction set that this machine supports.
template <class F>
void onAllTargets(const F& check) {
  for (const std::int64_t target : kernelTargets()) {
    useKernelTarget(target);
    INFO(kernelTargetName(target));
    check();
  }
  useKernelTarget(0);
}

}  // namespace lobe
