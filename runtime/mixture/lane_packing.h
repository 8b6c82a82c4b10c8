#pragma once
// From Gaussians to lanes and back, to the bit.

#include <array>
#include <span>

#include "runtime/mixture/gaussian.h"
#include "runtime/mixture/lanes.h"

namespace lobe {

/// The number of lanes that `count` components take.
constexpr int paddedLanes(int count) {
  return (count + kLaneStep - 1) / kLaneStep * kLaneStep;
}

/// Writes all components, and dead ones of weight 0 in the other lanes up to stride. data: kLaneFields · stride floats;
/// stride ≥ the number of components.
void packLanes(std::span<const Gaussian> mixture, float* data, int stride);

/// Component k, as it was packed.
Gaussian gaussianAt(const LanesView& lanes, int k);

/// All components of the view.
Mixture unpackLanes(const LanesView& lanes);

/// Room for up to `capacity` components, filled from the front. What lies behind them is undefined.
template <int capacity>
class LaneStore {
 public:
  static constexpr int kCapacity = capacity;
  /// Kernels write whole sets of lanes.
  static constexpr int kStride = paddedLanes(capacity) + kMostLanes;

  int count() const { return count_; }
  int room() const { return capacity - count_; }
  LanesView view() const { return {data_.data(), kStride, count_}; }

  /// For kernels that append: where field f of component k is to go is data()[f·kStride + k].
  float* data() { return data_.data(); }
  void grow(int by) { count_ += by; }

  /// count() < capacity.
  void add(const Gaussian& g);

 private:
  int count_ = 0;
  alignas(32) std::array<float, std::size_t{kLaneFields} * kStride> data_;
};

/// Writes one component to lane k.
void packLane(const Gaussian& g, float* data, int stride, int k);

template <int capacity>
void LaneStore<capacity>::add(const Gaussian& g) {
  packLane(g, data_.data(), kStride, count_);
  ++count_;
}

}  // namespace lobe
