#pragma once
// Pearson's χ² test of a sampler against its density.
//
//   const Chi2Result r = chi2Sphere([&] { return mySampler(rng); }, [&](const Eigen::Vector3d& w) { return pdf(w); });
//   INFO(r.message);
//   CHECK(r.passed(numberOfTests));
//
// The bins are built from the first half of the samples, so that each holds about the same number of them: a lobe of
// 1/1000 radian is tested as finely as a wide one. The density is integrated over each bin by adaptive quadrature,
// refined where the samples are. If the density integrates to less than 1, the sampler must reject the remaining
// fraction of samples (nullopt); a density whose integral differs from the fraction of accepted samples fails the test.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace lobe {

struct Chi2Options {
  int samples = 40000;         ///< for the test, after the same number to build the bins
  int bins = 128;              ///< a power of two
  double minExpected = 5.0;    ///< bins with lower expected counts are merged
  double significance = 0.01;  ///< of all tests together
  double massError = 3e-4;     ///< tolerance for the quadrature error of the density's integral
};

struct Chi2Result {
  double pValue = 0.0;  ///< 0 if the test is impossible or the density integrates to more than 1
  double significance = 0.01;
  std::string message;

  /// Whether the sampler passes as one of `tests` tests (Šidák's correction).
  bool passed(int tests = 1) const { return pValue > 1.0 - std::pow(1.0 - significance, 1.0 / tests); }
};

namespace chi2_detail {

using Point = Eigen::Vector2d;

struct Box {
  Point low, high;
  Point centre() const { return 0.5 * (low + high); }
};

/// Q(a, x), the regularised upper incomplete gamma function: series below a + 1, continued fraction above.
inline double upperGamma(double a, double x) {
  if (x <= 0.0) return 1.0;
  const double front = std::exp(-x + a * std::log(x) - std::lgamma(a));
  if (x < a + 1.0) {
    double term = 1.0 / a;
    double sum = term;
    for (int n = 1; n < 1000 && term > 1e-15 * sum; ++n) sum += term *= x / (a + n);
    return std::clamp(1.0 - front * sum, 0.0, 1.0);
  }
  double b = x + 1.0 - a;
  double c = 1e300;
  double d = 1.0 / b;
  double h = d;
  for (int n = 1; n < 1000; ++n) {
    const double step = -n * (n - a);
    b += 2.0;
    d = 1.0 / (step * d + b);
    c = b + step / c;
    h *= d * c;
    if (std::abs(d * c - 1.0) < 1e-14) break;
  }
  return std::clamp(front * h, 0.0, 1.0);
}

/// Gauss–Legendre with 3×3 points.
template <typename Density>
double gauss(const Density& density, const Box& box) {
  constexpr std::array<double, 3> kNode = {-0.7745966692414834, 0.0, 0.7745966692414834};
  constexpr std::array<double, 3> kWeight = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
  const Point centre = box.centre();
  const Point half = 0.5 * (box.high - box.low);
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      sum += kWeight[i] * kWeight[j] * density(Point(centre + half.cwiseProduct(Point(kNode[i], kNode[j]))));
  return 4.0 * sum * half.prod();
}

inline std::array<Box, 2> halves(const Box& box, int axis) {
  std::array<Box, 2> parts = {box, box};
  parts[0].high[axis] = parts[1].low[axis] = box.centre()[axis];
  return parts;
}

/// Integrates a density over boxes by recursive bisection. A quadrature rule that misses a narrow lobe reports no
/// error, so the samples control the refinement, too: a box is also halved if it contains many samples, if the rule
/// finds almost no mass in spite of some samples, or if the density at a sample is far above the mean that the rule
/// finds; along the axis on which the samples span the smaller fraction of the box.
template <typename Density>
class Quadrature {
 public:
  Quadrature(const Density& density, int samples) : density_(density), samples_(samples) {}

  double operator()(const Box& box, std::span<Point> points, int depth = 0) const {
    constexpr std::size_t kManySamples = 12;
    constexpr int kMaxDepth = 60;
    constexpr double kTolerance = 4e-7;
    int axis = narrowAxis(box, points, depth);
    if (points.size() <= kManySamples || depth == kMaxDepth) {
      const double whole = gauss(density_, box);
      const double x = halved(box, 0);
      const double y = halved(box, 1);
      const double error = std::max(std::abs(x - whole), std::abs(y - whole));
      const double mass = 0.5 * (x + y);
      const bool plausible =
          mass * samples_ >= 0.02 * static_cast<double>(points.size()) && !missesPeak(box, points, mass);
      if (depth == kMaxDepth || (plausible && error < kTolerance)) return x + y - whole;
      if (plausible) axis = std::abs(x - whole) > std::abs(y - whole) ? 0 : 1;
    }
    const std::array<Box, 2> parts = halves(box, axis);
    const double cut = parts[1].low[axis];
    const auto end = std::partition(points.begin(), points.end(), [&](const Point& p) { return p[axis] < cut; });
    const auto count = static_cast<std::size_t>(end - points.begin());
    return (*this)(parts[0], points.first(count), depth + 1) + (*this)(parts[1], points.subspan(count), depth + 1);
  }

 private:
  bool missesPeak(const Box& box, std::span<const Point> points, double mass) const {
    constexpr double kPeak = 16;
    const double area = (box.high - box.low).prod();
    return std::ranges::any_of(points, [&](const Point& p) { return density_(p) * area > kPeak * mass; });
  }

  double halved(const Box& box, int axis) const {
    const std::array<Box, 2> parts = halves(box, axis);
    return gauss(density_, parts[0]) + gauss(density_, parts[1]);
  }

  static int narrowAxis(const Box& box, std::span<const Point> points, int depth) {
    if (points.empty()) return depth % 2;
    Point low = points.front();
    Point high = low;
    for (const Point& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
    const Point fraction = (high - low).cwiseQuotient(box.high - box.low);
    if (fraction.minCoeff() > 0.5 || fraction.x() == fraction.y()) return depth % 2;
    return fraction.x() < fraction.y() ? 0 : 1;
  }

  const Density& density_;
  int samples_;
};

struct Bin {
  Box box{Point::Zero(), Point::Zero()};
  std::span<Point> points = {};  ///< of the first half of the samples
  double expected = 0.0;
  double observed = 0.0;
};

/// A tree of bins with equal numbers of points, split at medians.
class BinTree {
 public:
  BinTree(const Box& box, std::span<Point> points, int depth, std::vector<Bin>& bins) {
    if (depth == 0 || points.size() < 4) {
      bin_ = bins.size();
      bins.push_back({box, points});
      return;
    }
    axis_ = depth % 2;
    const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
    std::nth_element(points.begin(), middle, points.end(),
                     [&](const Point& a, const Point& b) { return a[axis_] < b[axis_]; });
    cut_ = (*middle)[axis_];
    // Equal points (of a sampler with few distinct values) must not end up on both sides of the cut.
    const auto upper = std::partition(points.begin(), points.end(), [&](const Point& p) { return p[axis_] < cut_; });
    const auto count = static_cast<std::size_t>(upper - points.begin());
    Box low = box;
    Box high = box;
    low.high[axis_] = high.low[axis_] = cut_;
    children_.reserve(2);
    children_.emplace_back(low, points.first(count), depth - 1, bins);
    children_.emplace_back(high, points.subspan(count), depth - 1, bins);
  }

  std::size_t find(const Point& p) const {
    return children_.empty() ? bin_ : children_[p[axis_] < cut_ ? 0 : 1].find(p);
  }

 private:
  int axis_ = 0;
  double cut_ = 0.0;
  std::size_t bin_ = 0;
  std::vector<BinTree> children_;
};

/// The χ² test over the bins, with small bins merged.
inline Chi2Result judge(std::vector<Bin> bins, const Chi2Options& options) {
  std::sort(bins.begin(), bins.end(), [](const Bin& a, const Bin& b) { return a.expected < b.expected; });
  Bin pool;
  double statistic = 0.0;
  int cells = 0;
  const Bin* worst = nullptr;
  double worstTerm = -1.0;
  const auto add = [&](const Bin& bin) {
    const double term = std::pow(bin.observed - bin.expected, 2) / bin.expected;
    statistic += term;
    ++cells;
    if (term > worstTerm) worstTerm = term, worst = &bin;
  };
  std::ostringstream message;
  Chi2Result result;
  result.significance = options.significance;
  std::size_t i = 0;
  for (; i < bins.size() && (bins[i].expected < options.minExpected || (i > 0 && pool.expected < options.minExpected));
       ++i)
    pool.expected += bins[i].expected, pool.observed += bins[i].observed;
  if (i > 0 && pool.expected > 0.0) add(pool);
  if (i > 0 && pool.expected <= 0.0 && pool.observed > 0.0) {
    message << pool.observed << " samples where the density is zero";
    result.message = message.str();
    return result;
  }
  for (; i < bins.size(); ++i) add(bins[i]);
  if (cells < 2) {
    result.message = "too few bins";
    return result;
  }
  result.pValue = upperGamma(0.5 * (cells - 1), 0.5 * statistic);
  message << "chi2 = " << statistic << ", cells = " << cells << ", p = " << result.pValue
          << "; worst cell (0 to 0: merged or rejected) [" << worst->box.low.transpose() << "] to ["
          << worst->box.high.transpose() << "]: observed " << worst->observed << ", expected " << worst->expected;
  result.message = message.str();
  return result;
}

}  // namespace chi2_detail

/// Tests a sampler of the unit square: sampler() returns std::optional<Eigen::Vector2d>, density(Eigen::Vector2d) its
/// density over the square. A sample outside the square counts as nullopt. breaks: x coordinates in (0,1) at which the
/// density is discontinuous; no bin crosses them.
template <typename Sampler, typename Density>
Chi2Result chi2Square(Sampler&& sampler, Density&& density, const Chi2Options& options = {},
                      std::vector<double> breaks = {}) {
  using namespace chi2_detail;
  const auto draw = [&]() -> std::optional<Point> {
    const std::optional<Eigen::Vector2d> p = sampler();
    if (!p || !((p->array() >= 0.0).all() && (p->array() <= 1.0).all())) return std::nullopt;
    return *p;
  };
  std::vector<Point> points;
  for (int i = 0; i < options.samples; ++i)
    if (const std::optional<Point> p = draw()) points.push_back(*p);

  std::vector<Bin> bins;
  std::vector<BinTree> trees;
  breaks.push_back(1.0);
  double low = 0.0;
  std::span<Point> rest(points);
  for (const double high : breaks) {
    const auto end =
        std::partition(rest.begin(), rest.end(), [&](const Point& p) { return p.x() < high || high == 1.0; });
    const auto count = static_cast<std::size_t>(end - rest.begin());
    trees.emplace_back(Box{{low, 0.0}, {high, 1.0}}, rest.first(count), static_cast<int>(std::log2(options.bins)),
                       bins);
    rest = rest.subspan(count);
    low = high;
  }

  Bin rejected;
  for (int i = 0; i < options.samples; ++i) {
    const std::optional<Point> p = draw();
    if (!p) {
      rejected.observed += 1.0;
      continue;
    }
    const auto at = std::upper_bound(breaks.begin(), breaks.end() - 1, p->x()) - breaks.begin();
    bins[trees[static_cast<std::size_t>(at)].find(*p)].observed += 1.0;
  }

  double mass = 0.0;
  const Quadrature integrate(density, options.samples);
  for (Bin& bin : bins) {
    const double fraction = integrate(bin.box, bin.points);
    mass += fraction;
    bin.expected = fraction * options.samples;
  }
  if (!(mass <= 1.0 + options.massError))
    return {0.0, options.significance, "the density integrates to " + std::to_string(mass)};
  // The fraction of rejected samples cannot be tested below the error of the quadrature.
  rejected.expected = std::max(1.0 - mass, options.massError) * options.samples;
  if (std::max(rejected.expected, rejected.observed) > 2.0 * options.massError * options.samples)
    bins.push_back(rejected);
  Chi2Result result = judge(std::move(bins), options);
  result.message += "; density integrates to " + std::to_string(mass) + ", rejected " +
                    std::to_string(rejected.observed / options.samples);
  return result;
}

/// The same for directions: sampler() returns std::optional<Eigen::Vector3f>, density(Eigen::Vector3f) is over solid
/// angle. Directions are mapped to the square by an area-preserving map of (elevation, azimuth), precise at both poles.
template <typename Sampler, typename Density>
Chi2Result chi2Sphere(Sampler&& sampler, Density&& density, const Chi2Options& options = {}) {
  constexpr double kTwoPi = 2.0 * std::numbers::pi;
  const auto toSquare = [&]() -> std::optional<Eigen::Vector2d> {
    const std::optional<Eigen::Vector3f> sample = sampler();
    if (!sample) return std::nullopt;
    const Eigen::Vector3d w = sample->template cast<double>().normalized();
    const double fromPole = w.template head<2>().squaredNorm() / (1.0 + std::abs(w.z()));  // 1 − |z|
    const double phi = std::atan2(w.y(), w.x()) / kTwoPi;
    return Eigen::Vector2d(0.5 * (w.z() > 0.0 ? fromPole : 2.0 - fromPole), phi < 0.0 ? phi + 1.0 : phi);
  };
  const auto overSquare = [&](const Eigen::Vector2d& p) {
    const double fromPole = 2.0 * std::min(p.x(), 1.0 - p.x());
    const double z = p.x() < 0.5 ? 1.0 - fromPole : fromPole - 1.0;
    const double r = std::sqrt(fromPole * (2.0 - fromPole));
    const double phi = kTwoPi * p.y();
    const Eigen::Vector3d w(r * std::cos(phi), r * std::sin(phi), z);
    return 2.0 * kTwoPi * static_cast<double>(density(Eigen::Vector3f(w.cast<float>())));
  };
  return chi2Square(toSquare, overSquare, options, {0.5});
}

}  // namespace lobe
