#pragma once
// Conversion of Gaussians to a structure of arrays (SoA) and back, without loss.

#include <array>
#include <span>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/soa_gaussians.h"

namespace lobe {

/// The number of components including padding lanes: `count` rounded up to a multiple of kPaddingMultiple.
constexpr int paddedCount(int count) {
  return (count + kPaddingMultiple - 1) / kPaddingMultiple * kPaddingMultiple;
}

/// Writes all components, and zero-weight padding up to the stride. data: kGaussianFields · stride floats; stride ≥ the
/// number of components.
void packGaussians(std::span<const Gaussian> mixture, float* data, int stride);

/// Component k, bit for bit as it was packed.
Gaussian gaussianAt(const GaussiansView& lanes, int k);

/// All components of the view.
Mixture unpackGaussians(const GaussiansView& lanes);

/// Storage for up to `capacity` components. The content behind the last component is undefined.
template <int capacity>
class GaussianStore {
 public:
  /// Includes padding lanes, because kernels write whole SIMD vectors.
  static constexpr int kStride = paddedCount(capacity) + kMaxVectorLanes;

  int count() const { return count_; }
  int room() const { return capacity - count_; }
  GaussiansView view() const { return {data_.data(), kStride, count_}; }

  /// For kernels that append components: field f of component k is data()[f·kStride + k]. Call grow afterwards.
  float* data() { return data_.data(); }
  void grow(int by) { count_ += by; }

  /// Appends a component. Requires room() > 0.
  void add(const Gaussian& g);

 private:
  int count_ = 0;
  alignas(32) std::array<float, std::size_t{kGaussianFields} * kStride> data_;
};

/// Writes one component as number k.
void packGaussian(const Gaussian& g, float* data, int stride, int k);

template <int capacity>
void GaussianStore<capacity>::add(const Gaussian& g) {
  packGaussian(g, data_.data(), kStride, count_);
  ++count_;
}

}  // namespace lobe
