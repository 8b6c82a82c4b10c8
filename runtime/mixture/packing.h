#pragma once
// From Gaussians to lanes and back, to the bit.

#include <array>
#include <span>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/soa_gaussians.h"

namespace lobe {

/// The number of lanes that `count` components take.
constexpr int paddedCount(int count) {
  return (count + kPaddingMultiple - 1) / kPaddingMultiple * kPaddingMultiple;
}

/// Writes all components, and dead ones of weight 0 in the other lanes up to stride. data: kGaussianFields · stride
/// floats; stride ≥ the number of components.
void packGaussians(std::span<const Gaussian> mixture, float* data, int stride);

/// Component k, as it was packed.
Gaussian gaussianAt(const GaussiansView& lanes, int k);

/// All components of the view.
Mixture unpackGaussians(const GaussiansView& lanes);

/// Room for up to `capacity` components, filled from the front. What lies behind them is undefined.
template <int capacity>
class GaussianStore {
 public:
  /// Kernels write whole sets of lanes.
  static constexpr int kStride = paddedCount(capacity) + kMaxVectorLanes;

  int count() const { return count_; }
  int room() const { return capacity - count_; }
  GaussiansView view() const { return {data_.data(), kStride, count_}; }

  /// For kernels that append: where field f of component k is to go is data()[f·kStride + k].
  float* data() { return data_.data(); }
  void grow(int by) { count_ += by; }

  /// count() < capacity.
  void add(const Gaussian& g);

 private:
  int count_ = 0;
  alignas(32) std::array<float, std::size_t{kGaussianFields} * kStride> data_;
};

/// Writes one component to lane k.
void packGaussian(const Gaussian& g, float* data, int stride, int k);

template <int capacity>
void GaussianStore<capacity>::add(const Gaussian& g) {
  packGaussian(g, data_.data(), kStride, count_);
  ++count_;
}

}  // namespace lobe
