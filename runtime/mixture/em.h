#pragma once
// Expectation maximisation (EM) for Gaussian mixtures on weighted points of the disc: the batch form used by the fitter
// (Herholz et al. 2016), and the stepwise on-line form with MAP priors that trains illumination records (Vorba et al.
// 2014).

#include <span>

#include "runtime/mixture/gaussian.h"

namespace lobe {

/// Largest number of Gaussians of a StepwiseEm.
inline constexpr int kMaxIlluminationComponents = 16;

struct WeightedPoint {
  Vec2 y;
  float weight;  ///< ≥ 0 and finite; points of zero weight are ignored
};

struct WeightedEmOptions {
  int maxSweeps = 100;
  double tolerance = 1e-4;    ///< relative change of the weighted log-likelihood that ends the iteration
  double minVariance = 1e-9;  ///< floor of each eigenvalue of Σ, in disc units²
};

/// Fits the mixture in place by weighted EM in double precision, starting from the given components. Their number does
/// not change; afterwards the weights sum to one and covariances are positive definite. Returns the number of
/// iterations; 0, with an unchanged mixture, if the mixture is empty or no point has a positive weight.
int weightedEm(std::span<const WeightedPoint> points, Mixture& mixture, const WeightedEmOptions& options = {});

/// The mean log-likelihood Σ w log p / Σ w over the points of positive weight, for p = background · 2cosθ/π +
/// (1−background) · mixture over the disc's area. −infinity if p is 0 at a point.
double meanLogLikelihood(std::span<const WeightedPoint> points, std::span<const Gaussian> mixture,
                         float background = 0);

/// An illumination mixture in training, u · 2cosθ/π + (1−u) · Σ π_k N_k over the disc, with its sufficient statistics.
/// The background component 2cosθ/π (cosθ = 1 − |y|²) is the density of L cosθ for constant radiance.
///
/// Points on or outside the edge of the disc, and points whose weight is not positive and finite, are always ignored.
/// The mixture stays valid for all input, such as fewer points than components, coincident points, points at the edge,
/// or weights of any magnitude. The result is invariant to scaling all weights that were ever passed. Points may be
/// sorted: they are visited with a stride.
class StepwiseEm {
 public:
  // The priors a, b and v of Vorba et al. 2014, Eq. 8 to 11.
  static constexpr float kStepExponent = 0.7f;  ///< η = (k+1)^(−exponent)
  static constexpr int kSamplesPerUpdate = 10;  ///< number of samples between M steps
  static constexpr float kPriorA = 0.01f, kPriorB = 4e-3f, kPriorV = 0.01f;
  static constexpr float kBackgroundPrior = 8.0f;  ///< Dirichlet pseudo-count of the background component
  static constexpr float kInitialBackground = 0.5f;
  static constexpr float kInitialVariance = 0.04f;  ///< variance of every component at the start of the first fit
  static constexpr float kMinDeterminant = 1e-11f;  ///< its square root is the floor of each eigenvalue of Σ
  static constexpr double kTolerance = 3e-3;  ///< change of the mean log-likelihood (nats) that ends the first fit
  static constexpr int kMaxSweeps = 250;      ///< largest number of sweeps of the first fit
  static constexpr int kMaxRefitSweeps = 4;   ///< largest number of sweeps of a refit

  /// A mixture with this number of Gaussians. Throws std::runtime_error unless it is from 1 to
  /// kMaxIlluminationComponents.
  explicit StepwiseEm(int components);

  /// The first fit. Discards the previous state, initialises the means deterministically from the points, and sweeps
  /// over the points until the likelihood converges. Does nothing if no point is valid. The priors are weighed against
  /// the effective number of samples, (Σw)²/Σw², so that a bright particle among many dim ones counts as one sample.
  void fit(std::span<const WeightedPoint> points);

  /// Performs one sweep of on-line EM over new points.
  void update(std::span<const WeightedPoint> points);

  /// Batch EM with the same priors, from the current mixture, on points that stand for all those of fit and update,
  /// such as a bounded sample of them. On-line EM discounts old points: of k it keeps the evidence of about k^0.7,
  /// while its priors are weighed against k. Ends when the likelihood converges, at most after kMaxRefitSweeps. The
  /// mixture can be updated further. Does nothing if no point is valid.
  void refit(std::span<const WeightedPoint> points);

  const Mixture& gaussians() const { return gaussians_; }  ///< weights sum to 1
  float background() const { return background_; }         ///< u in [0,1]
  long samplesSeen() const { return samples_; }            ///< number of valid points of fit and update
  /// The density u · 2cosθ/π + (1−u) · G(y) over the disc's area.
  float pdf(const Vec2& y) const;

 private:
  struct Statistics {
    double weight = 0;              // g_k
    double x = 0, y = 0;            // s_k
    double xx = 0, xy = 0, yy = 0;  // C_k
  };
  template <int lanes>
  class Sweep;
  void spread(std::span<const WeightedPoint> points);
  double sweep(std::span<const WeightedPoint> points, double evidenceBefore, double evidenceAfter);

  Mixture gaussians_;
  float background_;
  std::vector<Statistics> statistics_;
  double backgroundWeight_ = 0;
  double totalWeight_ = 0;
  double evidence_ = 0;  // effective number of samples so far
  long samples_ = 0;
};

}  // namespace lobe
