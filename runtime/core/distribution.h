#pragma once
// A discrete distribution, sampled by inversion of its cumulative distribution.

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "runtime/core/sampling.h"

namespace lobe {

/// A distribution of indices with probabilities proportional to non-negative weights.
class DiscreteDistribution {
 public:
  DiscreteDistribution() = default;
  explicit DiscreteDistribution(std::span<const float> weights)
      : DiscreteDistribution(std::vector<double>(weights.begin(), weights.end())) {}
  explicit DiscreteDistribution(const std::vector<double>& weights)
      : cumulative_(weights.size()), guide_(weights.size()) {
    for (std::size_t i = 0; i < weights.size(); ++i) cumulative_[i] = total_ += weights[i];
    std::size_t i = 0;
    for (std::size_t k = 0; k < guide_.size(); ++k) {
      while (i + 1 < size() && cumulative_[i] <= total_ * static_cast<double>(k) / static_cast<double>(size())) ++i;
      guide_[k] = static_cast<std::uint32_t>(i);
    }
  }

  std::size_t size() const { return cumulative_.size(); }
  /// Sum of the weights. If it is 0, sample and probability must not be called.
  double total() const { return total_; }
  double weight(std::size_t i) const { return cumulative_[i] - (i > 0 ? cumulative_[i - 1] : 0.0); }
  float probability(std::size_t i) const { return static_cast<float>(weight(i) / total_); }

  /// Samples an index with u uniform in [0,1), and rescales u to be uniform in [0,1) again. A number keeps as many
  /// random bits as the index leaves, so use double if u serves for more than one choice. Requires total() > 0. Takes
  /// constant time on average.
  template <std::floating_point Real>
  std::size_t sample(Real& u) const {
    const double target = u * total_;
    std::size_t i = guide_[std::min(static_cast<std::size_t>(u * static_cast<double>(size())), size() - 1)];
    while (i + 1 < size() && cumulative_[i] <= target) ++i;
    return finish(i, size(), target, u);
  }

  /// Samples an index in [first, last) in the same way; probabilities are relative to mass(first, last), which must be
  /// positive. Takes logarithmic time.
  template <std::floating_point Real>
  std::size_t sample(Real& u, std::size_t first, std::size_t last) const {
    if (first == 0 && last == size()) return sample(u);
    const double low = first > 0 ? cumulative_[first - 1] : 0.0;
    const double target = low + u * (cumulative_[last - 1] - low);
    const auto begin = cumulative_.begin();
    const auto found = std::upper_bound(begin + first, begin + last, target);
    return finish(static_cast<std::size_t>(found - begin), last, target, u);
  }

  /// Sum of the weights in [first, last).
  double mass(std::size_t first, std::size_t last) const {
    return last > first ? cumulative_[last - 1] - (first > 0 ? cumulative_[first - 1] : 0.0) : 0.0;
  }

 private:
  // Rescales u to the position of the target within the weight of index i. If rounding has placed the target at the end
  // of the range, the last index with positive weight is used.
  template <std::floating_point Real>
  std::size_t finish(std::size_t i, std::size_t last, double target, Real& u) const {
    i = std::min(i, last - 1);
    while (i > 0 && !(cumulative_[i] > cumulative_[i - 1])) --i;
    const double below = i > 0 ? cumulative_[i - 1] : 0.0;
    constexpr Real one = 1;
    constexpr Real most = one - std::numeric_limits<Real>::epsilon() / 2;  // the largest number below 1
    u = std::clamp(static_cast<Real>((target - below) / (cumulative_[i] - below)), Real{0}, most);
    return i;
  }

  std::vector<double> cumulative_;
  std::vector<std::uint32_t> guide_;  // first index to search for each of size() equal parts of [0, total)
  double total_ = 0;
};

}  // namespace lobe
