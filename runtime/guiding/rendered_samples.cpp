#include "runtime/guiding/rendered_samples.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>

namespace lobe {

// A total order, so that the result does not depend on the order of equal priorities either.
bool RenderedSamples::Kept::operator>(const Kept& other) const {
  const auto key = [](const Kept& k) { return std::tuple(k.priority, k.point.weight, k.point.y.x(), k.point.y.y()); };
  return key(*this) > key(other);
}

void RenderedSamples::add(std::uint32_t record, const Vec2& y, float weight, float u) {
  if (!(weight > 0) || !std::isfinite(weight)) return;
  const float priority = weight / (1 - u);
  const std::lock_guard lock(lockOf(record));
  OfRecord& samples = ofRecord_[record];
  if (priority < samples.threshold) return;
  samples.kept.push_back({{y, weight}, priority});
  // Some more than necessary are kept, so that they are rarely sorted.
  if (samples.kept.size() > capacity_ + capacity_ / 4) drop(samples);
}

void RenderedSamples::drop(OfRecord& samples) const {
  if (samples.kept.size() <= capacity_) return;
  const auto end = samples.kept.begin() + static_cast<std::ptrdiff_t>(capacity_);
  std::ranges::nth_element(samples.kept, end, std::greater<>());
  samples.threshold = end->priority;
  samples.kept.erase(end, samples.kept.end());
}

RenderedSamples::OfRecord RenderedSamples::ordered(std::size_t record) const {
  OfRecord samples = ofRecord_[record];
  drop(samples);
  std::ranges::sort(samples.kept, std::greater<>());
  return samples;
}

std::vector<WeightedPoint> RenderedSamples::points(std::size_t record) const {
  const OfRecord samples = ordered(record);
  std::vector<WeightedPoint> points;
  points.reserve(samples.kept.size());
  for (const Kept& k : samples.kept) points.push_back({k.point.y, std::max(k.point.weight, samples.threshold)});
  return points;
}

std::vector<WeightedPoint> RenderedSamples::effectivePoints(std::size_t record) const {
  const OfRecord samples = ordered(record);
  // Estimates of Σw and Σw² (PointReservoir).
  double sum = 0, squares = 0;
  for (const Kept& k : samples.kept) {
    const double weight = std::max(k.point.weight, samples.threshold);
    sum += weight;
    squares += weight * k.point.weight;
  }
  std::vector<WeightedPoint> points;
  points.reserve(samples.kept.size());
  for (const Kept& k : samples.kept)
    points.push_back({k.point.y, static_cast<float>(std::max(k.point.weight, samples.threshold) * (sum / squares))});
  return points;
}

}  // namespace lobe
