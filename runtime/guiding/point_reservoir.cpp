#include "runtime/guiding/point_reservoir.h"

#include <algorithm>
#include <cmath>

namespace lobe {

void PointReservoir::add(std::span<const WeightedPoint> points) {
  if (capacity_ == 0) return;
  std::vector<Kept> all;
  all.reserve(kept_.size() + points.size());
  all = kept_;
  for (const WeightedPoint& p : points)
    if (p.weight > 0 && std::isfinite(p.weight)) all.push_back({p, p.weight / (1 - rng_.uniform())});
  if (all.size() > capacity_) {
    const auto end = all.begin() + static_cast<std::ptrdiff_t>(capacity_);
    std::ranges::nth_element(all, end, std::ranges::greater(), &Kept::priority);
    threshold_ = std::max(threshold_, end->priority);
    all.erase(end, all.end());
  }
  kept_.assign(all.begin(), all.end());  // allocates no more than it needs
}

std::vector<WeightedPoint> PointReservoir::points() const {
  std::vector<WeightedPoint> points;
  points.reserve(kept_.size());
  for (const Kept& k : kept_) points.push_back({k.point.y, std::max(k.point.weight, threshold_)});
  return points;
}

}  // namespace lobe
