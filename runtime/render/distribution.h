#pragma once
// Discrete and piecewise-constant distributions in one and two dimensions.

#include <algorithm>
#include <span>
#include <vector>

#include "materials/sampling.h"

namespace lobe {

/// Indices in proportion to non-negative weights.
class DiscreteDistribution {
 public:
  DiscreteDistribution() = default;
  explicit DiscreteDistribution(std::span<const float> weights) : cumulative_(weights.size()) {
    for (std::size_t i = 0; i < weights.size(); ++i) cumulative_[i] = total_ += weights[i];
  }

  std::size_t size() const { return cumulative_.size(); }
  /// Sum of the weights. 0: nothing may be sampled.
  double total() const { return total_; }
  double weight(std::size_t i) const { return cumulative_[i] - (i > 0 ? cumulative_[i - 1] : 0.0); }
  float probability(std::size_t i) const { return static_cast<float>(weight(i) / total_); }

  /// An index for u uniform in [0,1), which is made uniform again. Only indices in [first, last) when given (their
  /// weights have a positive sum), then with probabilities relative to mass(first, last).
  std::size_t sample(float& u, std::size_t first, std::size_t last) const {
    const double low = first > 0 ? cumulative_[first - 1] : 0.0;
    const double target = low + u * (cumulative_[last - 1] - low);
    const auto begin = cumulative_.begin();
    const auto found = std::upper_bound(begin + first, begin + last, target);
    auto i = static_cast<std::size_t>(found - begin);
    if (i == last) i = lastPositive(last);
    const double below = i > 0 ? cumulative_[i - 1] : 0.0;
    u = std::clamp(static_cast<float>((target - below) / (cumulative_[i] - below)), 0.0f, kOneMinusEpsilon);
    return i;
  }
  std::size_t sample(float& u) const { return sample(u, 0, size()); }

  double mass(std::size_t first, std::size_t last) const {
    return last > first ? cumulative_[last - 1] - (first > 0 ? cumulative_[first - 1] : 0.0) : 0.0;
  }

 private:
  // Rounding may push the target onto the end: the last index that has a weight is meant then.
  std::size_t lastPositive(std::size_t last) const {
    std::size_t i = last - 1;
    while (i > 0 && !(cumulative_[i] > cumulative_[i - 1])) --i;
    return i;
  }

  std::vector<double> cumulative_;
  double total_ = 0;
};

}  // namespace lobe
