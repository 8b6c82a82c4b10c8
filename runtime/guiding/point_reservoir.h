#pragma once
// A bounded sample of the points that a record has been trained with.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/core/random.h"
#include "runtime/mixture/em.h"

namespace lobe {

/// Priority sampling (Duffield, Lund and Thorup 2007): a point of weight w gets the priority w/u with u uniform in
/// (0, 1], and the points of largest priority are kept. With τ the largest priority among the other points, the sum of
/// max(w, τ) f over the kept points estimates the sum of w f over all points without bias, for any f.
class PointReservoir {
 public:
  /// capacity: largest number of points kept, 16 bytes each. The random numbers depend on seed, stream and index.
  PointReservoir(std::size_t capacity, std::uint64_t seed, std::uint64_t stream, std::uint64_t index)
      : capacity_(capacity), rng_(seed, stream, index) {}

  /// Points whose weight is not positive and finite are ignored.
  void add(std::span<const WeightedPoint> points);

  /// The kept points with weights max(w, τ); the points themselves if none was dropped.
  std::vector<WeightedPoint> points() const;

 private:
  struct Kept {
    WeightedPoint point;
    float priority;
  };
  std::size_t capacity_;
  Rng rng_;
  std::vector<Kept> kept_;
  float threshold_ = 0;  // τ
};

}  // namespace lobe
