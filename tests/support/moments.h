#pragma once
// The mean of samples with its standard error, and tests against a true value.

#include <algorithm>
#include <cmath>

namespace lobe::test {

/// Running mean and standard error.
class Moments {
 public:
  void add(double x) {
    ++n_;
    const double d = x - mean_;
    mean_ += d / n_;
    squares_ += d * (x - mean_);
  }
  double mean() const { return mean_; }
  double error() const { return std::sqrt(std::max(0.0, squares_) / (n_ - 1.0) / n_); }

 private:
  double n_ = 0, mean_ = 0, squares_ = 0;
};

/// Distance of the mean from the truth in standard errors; a relative error of 10⁻⁵ is allowed for rounding.
inline double deviation(const Moments& m, double truth) {
  return std::abs(m.mean() - truth) / std::hypot(m.error(), 1e-5 * truth);
}
/// The same for two estimates of the same quantity.
inline double deviation(const Moments& a, const Moments& b) {
  return std::abs(a.mean() - b.mean()) / std::hypot(a.error(), b.error(), 1e-5 * a.mean());
}
/// Exceeded by chance with probability 1/15 000.
inline constexpr double kMaxDeviation = 4.0;

}  // namespace lobe::test
