#pragma once
// Order statistics of samples.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

namespace lobe {

/// The q-quantile, q in [0, 1], interpolated linearly between the two nearest values. NaN if there are no values.
inline double quantile(std::vector<double> values, double q) {
  if (values.empty()) return NAN;
  std::ranges::sort(values);
  const double position = q * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (position - static_cast<double>(below)) * (values[above] - values[below]);
}

inline double median(std::vector<double> values) {
  return quantile(std::move(values), 0.5);
}

/// The mean without the largest values: without this fraction of them, in [0, 1), rounded down. NaN if there are no
/// values.
inline double trimmedMean(std::vector<double> values, double fraction) {
  if (values.empty()) return NAN;
  std::ranges::sort(values);
  const std::size_t kept = values.size() - static_cast<std::size_t>(fraction * static_cast<double>(values.size()));
  return std::accumulate(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(kept), 0.0) /
         static_cast<double>(kept);
}

}  // namespace lobe
