#pragma once
// Samples of the incident radiance at path vertices of a render, by the illumination record that served the vertex,
// from which the records are fitted once more while the picture is rendered.

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "runtime/mixture/em.h"

namespace lobe {

/// A bounded sample for every record, by priority sampling as in PointReservoir. Its content does not depend on the
/// order in which samples are added, and so not on threads.
class RenderedSamples {
 public:
  /// records: number of records. capacity: largest number of samples that is kept for each, > 0, at 16 bytes each.
  RenderedSamples(std::size_t records, std::size_t capacity) : capacity_(capacity), ofRecord_(records) {}

  /// Whether samples are wanted. May be changed while no thread adds samples.
  bool open() const { return open_; }
  void setOpen(bool open) { open_ = open; }

  /// Adds a direction, as a disc point in the frame of the record's mixture, with the weight L cosθ / pdf. L is an
  /// estimate (luminance) of the incident radiance without the part that next-event estimation covers, that is, times
  /// its multiple importance weight; pdf is the density over solid angle with which the direction was sampled. u: a
  /// random number, uniform in [0,1). Weights that are not positive and finite are ignored. Thread-safe.
  void add(std::uint32_t record, const Vec2& y, float weight, float u);

  /// The number of records.
  std::size_t records() const { return ofRecord_.size(); }
  /// The samples kept for a record, with weights max(w, τ) as in PointReservoir::points, in an order that depends only
  /// on them. Must not run while samples are added.
  std::vector<WeightedPoint> points(std::size_t record) const;
  /// The same, with the weights scaled to sum to an estimate of the effective number of the samples that were added,
  /// (Σw)²/Σw², as those of a pass of training do.
  std::vector<WeightedPoint> effectivePoints(std::size_t record) const;

 private:
  struct Kept {
    WeightedPoint point;
    float priority;
    bool operator>(const Kept& other) const;
  };
  struct OfRecord {
    std::vector<Kept> kept;  // at least those of the `capacity` largest priorities
    float threshold = 0;     // τ: the largest priority that was dropped
  };
  void drop(OfRecord& samples) const;
  OfRecord ordered(std::size_t record) const;
  std::mutex& lockOf(std::uint32_t record) { return locks_[record % locks_.size()]; }

  std::size_t capacity_;
  std::vector<OfRecord> ofRecord_;
  std::vector<std::mutex> locks_ = std::vector<std::mutex>(1024);
  bool open_ = true;
};

}  // namespace lobe
