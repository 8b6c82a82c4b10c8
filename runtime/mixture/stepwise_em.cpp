#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "runtime/core/random.h"
#include "runtime/mixture/eigenvalue_floor.h"
#include "runtime/mixture/em.h"
#include "runtime/mixture/fast_exp.h"

namespace lobe {

namespace {

constexpr float kInvPi = std::numbers::inv_pi_v<float>;

constexpr std::uint64_t kStartSeed = 7;

bool counts(const WeightedPoint& p) {
  return p.weight > 0 && std::isfinite(p.weight) && insideDisc(p.y);
}

struct Evidence {
  long points = 0;
  double effective = 0;
};

Evidence evidenceOf(std::span<const WeightedPoint> points) {
  Evidence evidence;
  double sum = 0, squares = 0;
  for (const WeightedPoint& p : points) {
    if (!counts(p)) continue;
    ++evidence.points;
    sum += p.weight;
    squares += static_cast<double>(p.weight) * p.weight;
  }
  if (squares > 0) evidence.effective = sum * sum / squares;
  return evidence;
}

float backgroundPdf(const Vec2& y) {
  return 2.0f * kInvPi * discCosine(y);
}

// The first index at which the running sum of the weights exceeds `target`; the last one with positive weight if
// rounding prevents that.
std::size_t choose(std::span<const double> weights, double target) {
  std::size_t last = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    last = i;
    if (target < weights[i]) break;
    target -= weights[i];
  }
  return last;
}

// A stride that visits each of n points once and separates points that are adjacent in the given order. On-line EM
// discounts earlier points; with points sorted by direction, it would otherwise fit mainly the last directions.
std::size_t scatteringStride(std::size_t n) {
  auto stride = static_cast<std::size_t>(static_cast<double>(n) * (std::numbers::phi - 1));
  while (std::gcd(stride, n) > 1) ++stride;
  return stride;
}

}  // namespace

// The state of one sweep, copied from the mixture and stored back at its end. Components are a structure of arrays of
// fixed size with zero-weight padding, so that the loops over them vectorise. Does not allocate.
template <int lanes>
class StepwiseEm::Sweep {
 public:
  explicit Sweep(const StepwiseEm& em);
  void store(StepwiseEm& em) const;

  /// Multiplies the statistics by `keep` and adds a point with the factor `gain`; returns the mixture's density there.
  float add(const WeightedPoint& point, double keep, double gain);
  /// Sets the statistics to zero.
  void clear();
  /// Performs the M step for n effective samples, against which the priors are weighed.
  void maximise(double n);

 private:
  void prepare();
  Covariance covariance(int k, double n) const;

  // For the E step: means, parts of the inverse Cholesky factor, and scale = (1−u) π / (2π sqrt|Σ|).
  alignas(64) std::array<float, lanes> x_{};
  std::array<float, lanes> y_{}, slope_{}, along_{}, across_{}, scale_{};
  std::array<double, lanes> g_{}, sx_{}, sy_{}, cxx_{}, cxy_{}, cyy_{};
  std::array<Gaussian, lanes> gaussians_{};
  double totalWeight_, backgroundWeight_;
  int count_;
  float background_;
};

template <int lanes>
StepwiseEm::Sweep<lanes>::Sweep(const StepwiseEm& em)
    : totalWeight_(em.totalWeight_),
      backgroundWeight_(em.backgroundWeight_),
      count_(static_cast<int>(em.gaussians_.size())),
      background_(em.background_) {
  for (int k = 0; k < count_; ++k) {
    const Statistics& s = em.statistics_[k];
    gaussians_[k] = em.gaussians_[k];
    g_[k] = s.weight, sx_[k] = s.x, sy_[k] = s.y, cxx_[k] = s.xx, cxy_[k] = s.xy, cyy_[k] = s.yy;
  }
  prepare();
}

template <int lanes>
void StepwiseEm::Sweep<lanes>::store(StepwiseEm& em) const {
  for (int k = 0; k < count_; ++k) {
    em.gaussians_[k] = gaussians_[k];
    em.statistics_[k] = {g_[k], sx_[k], sy_[k], cxx_[k], cxy_[k], cyy_[k]};
  }
  em.background_ = background_;
  em.totalWeight_ = totalWeight_;
  em.backgroundWeight_ = backgroundWeight_;
}

template <int lanes>
void StepwiseEm::Sweep<lanes>::prepare() {
  for (int k = 0; k < count_; ++k) {
    const Gaussian& g = gaussians_[k];
    const float det = g.cov.determinant();
    x_[k] = g.meanX;
    y_[k] = g.meanY;
    slope_[k] = g.cov.xy / g.cov.xx;
    along_[k] = -0.5f / g.cov.xx;
    across_[k] = -0.5f * g.cov.xx / det;
    scale_[k] = (1.0f - background_) * g.weight * (0.5f * kInvPi) / std::sqrt(det);
  }
}

template <int lanes>
float StepwiseEm::Sweep<lanes>::add(const WeightedPoint& point, double keep, double gain) {
  const float px = point.y.x(), py = point.y.y();
  alignas(64) std::array<float, lanes> density;
  float sum = 0;
  for (int k = 0; k < lanes; ++k) {
    const float dx = px - x_[k], dy = py - y_[k] - slope_[k] * dx;
    density[k] = scale_[k] * expNegative(dx * dx * along_[k] + dy * dy * across_[k]);
  }
  for (int k = 0; k < lanes; ++k) sum += density[k];
  const float flat = background_ * backgroundPdf(point.y);
  const float total = sum + flat;
  const double weight = gain * point.weight;
  totalWeight_ = keep * totalWeight_ + weight;
  // If all densities underflow, the point is attributed to the background.
  const double scale = total > 0 ? weight / total : 0;
  backgroundWeight_ = keep * backgroundWeight_ + (total > 0 ? scale * flat : weight);
  const double x = px, y = py, xx = x * x, xy = x * y, yy = y * y;
  for (int k = 0; k < lanes; ++k) {
    const double q = scale * density[k];
    g_[k] = keep * g_[k] + q;
    sx_[k] = keep * sx_[k] + q * x;
    sy_[k] = keep * sy_[k] + q * y;
    cxx_[k] = keep * cxx_[k] + q * xx;
    cxy_[k] = keep * cxy_[k] + q * xy;
    cyy_[k] = keep * cyy_[k] + q * yy;
  }
  return total;
}

template <int lanes>
void StepwiseEm::Sweep<lanes>::clear() {
  g_ = sx_ = sy_ = cxx_ = cxy_ = cyy_ = {};
  totalWeight_ = backgroundWeight_ = 0;
}

// Σ_k = (b I + n V_k)/(a + n u_k), where V_k is the scatter of the component divided by the weight of all points.
template <int lanes>
Covariance StepwiseEm::Sweep<lanes>::covariance(int k, double n) const {
  const double mx = sx_[k] / g_[k], my = sy_[k] / g_[k], perWeight = n / totalWeight_;
  const double inverse = 1 / (kPriorA + g_[k] * perWeight);
  return withEigenvalueFloor((kPriorB + (cxx_[k] - mx * sx_[k]) * perWeight) * inverse,
                             (cxy_[k] - mx * sy_[k]) * perWeight * inverse,
                             (kPriorB + (cyy_[k] - my * sy_[k]) * perWeight) * inverse, std::sqrt(kMinDeterminant));
}

template <int lanes>
void StepwiseEm::Sweep<lanes>::maximise(double n) {
  // The MAP estimate under a Dirichlet prior over all K + 1 weights. The Gaussians' weights are relative to their sum.
  const double pseudo = kPriorV, perWeight = n / totalWeight_;
  const double all = n + count_ * pseudo + kBackgroundPrior;
  background_ = static_cast<float>((backgroundWeight_ * perWeight + kBackgroundPrior) / all);
  double gaussianWeight = 0;
  for (int k = 0; k < count_; ++k) gaussianWeight += g_[k] * perWeight + pseudo;
  for (int k = 0; k < count_; ++k) {
    gaussians_[k].weight = static_cast<float>((g_[k] * perWeight + pseudo) / gaussianWeight);
    if (!(g_[k] > 1e-12 * totalWeight_)) continue;  // underflow: mean and covariance are kept
    gaussians_[k].meanX = static_cast<float>(sx_[k] / g_[k]);
    gaussians_[k].meanY = static_cast<float>(sy_[k] / g_[k]);
    gaussians_[k].cov = covariance(k, n);
  }
  prepare();
}

StepwiseEm::StepwiseEm(int components) : background_(kInitialBackground) {
  if (components < 1 || components > kMaxIlluminationComponents)
    throw std::runtime_error("the number of components of an illumination mixture must be between 1 and 16");
  const Covariance wide{kInitialVariance, 0.0f, kInitialVariance};
  // Means on a spiral that covers the disc uniformly.
  constexpr float kGoldenAngle = 2.39996323f;
  const auto count = static_cast<float>(components);
  for (int k = 0; k < components; ++k) {
    const float radius = std::sqrt((static_cast<float>(k) + 0.5f) / count),
                angle = kGoldenAngle * static_cast<float>(k);
    gaussians_.push_back({1.0f / count, radius * std::cos(angle), radius * std::sin(angle), wide});
  }
  statistics_.resize(gaussians_.size());
}

// Initialises the means by k-means++ (Arthur and Vassilvitskii 2007): each is a point chosen in proportion to weight ×
// squared distance from the means chosen before. Of the initialisations tried, this is the only one that worked for all
// orders of points and magnitudes of weights. If no points are left, the remaining components keep their initial means.
void StepwiseEm::spread(std::span<const WeightedPoint> points) {
  Rng rng(kStartSeed);
  // Weight × squared distance to the nearest mean; only the weight for the first mean.
  std::vector<double> pull;
  pull.reserve(points.size());
  for (const WeightedPoint& p : points) pull.push_back(counts(p) ? p.weight : 0.0);
  for (Gaussian& g : gaussians_) {
    const double total = std::accumulate(pull.begin(), pull.end(), 0.0);
    if (!(total > 0)) break;
    const Vec2 mean = points[choose(pull, total * rng.uniform())].y;
    g.meanX = mean.x();
    g.meanY = mean.y();
    const bool first = &g == &gaussians_.front();
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!(pull[i] > 0)) continue;
      const double fresh = static_cast<double>(points[i].weight) * (points[i].y - mean).squaredNorm();
      pull[i] = first ? fresh : std::min(pull[i], fresh);
    }
  }
}

void StepwiseEm::fit(std::span<const WeightedPoint> points) {
  const Evidence evidence = evidenceOf(points);
  if (evidence.points == 0) return;
  *this = StepwiseEm(static_cast<int>(gaussians_.size()));
  spread(points);
  double previous = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < kMaxSweeps; ++i) {
    const double likelihood = sweep(points, i == 0 ? 0.0 : evidence.effective, evidence.effective);
    if (std::abs(likelihood - previous) <= kTolerance) break;
    previous = likelihood;
  }
  samples_ = evidence.points;
  evidence_ = evidence.effective;
}

void StepwiseEm::update(std::span<const WeightedPoint> points) {
  const double after = evidence_ + evidenceOf(points).effective;
  sweep(points, evidence_, after);
  evidence_ = after;
}

// Returns the weighted mean of the log-likelihood of each point before it was added.
double StepwiseEm::sweep(std::span<const WeightedPoint> points, double evidenceBefore, double evidenceAfter) {
  const auto run = [&]<int lanes>() {
    Sweep<lanes> state(*this);
    double likelihood = 0, weight = 0;
    int waiting = 0;
    const auto evidence = [&](std::size_t taken) {
      return std::lerp(evidenceBefore, evidenceAfter, static_cast<double>(taken) / static_cast<double>(points.size()));
    };
    const std::size_t stride = scatteringStride(points.size());
    for (std::size_t i = 0, at = 0; i < points.size(); ++i, at = (at + stride) % points.size()) {
      const WeightedPoint& p = points[at];
      if (!counts(p)) continue;
      const double step = std::pow(static_cast<float>(samples_ + 1), -kStepExponent);
      const float density = state.add(p, 1 - step, step);
      ++samples_;
      likelihood += p.weight * std::log(std::max(density, std::numeric_limits<float>::min()));
      weight += p.weight;
      if (++waiting < kSamplesPerUpdate) continue;
      state.maximise(evidence(i + 1));
      waiting = 0;
    }
    if (waiting > 0) state.maximise(evidence(points.size()));
    state.store(*this);
    return weight > 0 ? likelihood / weight : 0.0;
  };
  return gaussians_.size() <= 8 ? run.template operator()<8>() : run.template operator()<16>();
}

void StepwiseEm::refit(std::span<const WeightedPoint> points) {
  const Evidence evidence = evidenceOf(points);
  if (evidence.points == 0) return;
  const auto run = [&]<int lanes>() {
    Sweep<lanes> state(*this);
    double previous = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < kMaxRefitSweeps; ++i) {
      state.clear();
      double likelihood = 0, weight = 0;
      for (const WeightedPoint& p : points) {
        if (!counts(p)) continue;
        // Means over the points, as the statistics of on-line EM are.
        const float density = state.add(p, 1, 1.0 / static_cast<double>(evidence.points));
        likelihood += p.weight * std::log(std::max(density, std::numeric_limits<float>::min()));
        weight += p.weight;
      }
      state.maximise(evidence.effective);
      if (std::abs(likelihood / weight - previous) <= kTolerance) break;
      previous = likelihood / weight;
    }
    state.store(*this);
  };
  gaussians_.size() <= 8 ? run.template operator()<8>() : run.template operator()<16>();
}

float StepwiseEm::pdf(const Vec2& y) const {
  return background_ * backgroundPdf(y) + (1.0f - background_) * mixturePdf(gaussians_, y);
}

}  // namespace lobe
