#pragma once
// Expectation maximisation on weighted points of the disc: the static form the fitter uses (Herholz et al. 2016) and
// the stepwise on-line form with MAP priors that trains the illumination (Vorba et al. 2014).

#include <span>

#include "runtime/mixture/gaussian.h"

namespace lobe {

/// The most Gaussians that a mixture in training may have.
inline constexpr int kMaxIlluminationComponents = 16;

struct WeightedPoint {
  Vec2 y;
  float weight;  ///< ≥ 0 and finite; points of weight 0 are ignored
};

struct WeightedEmOptions {
  int maxSweeps = 100;
  double tolerance = 1e-4;    ///< relative change of the weighted log-likelihood that ends the iteration
  double minVariance = 1e-9;  ///< floor of each eigenvalue of Σ, in disc units²
};

/// Fits in place by weighted EM (in double precision), starting from the given components; their number stays, weights
/// sum to one, covariances stay positive definite. Returns the number of sweeps; 0 leaves the mixture as it was (no
/// point has a positive weight).
int weightedEm(std::span<const WeightedPoint> points, Mixture& mixture, const WeightedEmOptions& options = {});

/// Σ w log G / Σ w over points of positive weight. −infinity when a point has density 0.
double meanLogLikelihood(std::span<const WeightedPoint> points, std::span<const Gaussian> mixture,
                         float background = 0);

/// An illumination mixture in training: u · 2cosθ/π + (1−u) · Σ π_k N_k over the disc, with its sufficient statistics.
/// The background component 2cosθ/π (cosθ = 1 − |y|²) is what constant radiance makes of L cosθ.
///
/// Points on or outside the disc's edge, and those whose weight is not positive and finite, are ignored everywhere. The
/// mixture is valid whatever the points: fewer of them than components, all in one place, at the edge, or with weights
/// of any magnitude. Scaling all weights that were ever passed changes nothing. Points may come in any order, sorted
/// too: every sweep strides over them.
class StepwiseEm {
 public:
  // The names of the priors are those of Vorba et al. 2014, Eq. 8 to 11.
  static constexpr float kStepExponent = 0.7f;  ///< η = (k+1)^(−exponent)
  static constexpr int kSamplesPerUpdate = 10;  ///< samples between two M steps
  static constexpr float kPriorA = 0.01f, kPriorB = 4e-3f, kPriorV = 0.01f;
  static constexpr float kBackgroundPrior = 8.0f;  ///< Dirichlet pseudo-count of the background component
  static constexpr float kInitialBackground = 0.5f;
  static constexpr float kInitialVariance = 0.04f;  ///< of every component at the start of the first fit
  static constexpr float kMinDeterminant = 1e-11f;  ///< its square root is the floor of each eigenvalue of Σ
  static constexpr double kTolerance = 3e-3;  ///< change of the mean log-likelihood (nats) that ends the first fit
  static constexpr int kMaxSweeps = 250;      ///< of the first fit

  /// components Gaussians, 1 ≤ components ≤ kMaxIlluminationComponents.
  explicit StepwiseEm(int components);

  /// First fit, from nothing: starts from the points themselves (deterministically) and sweeps until the likelihood
  /// settles. The samples seen become the number of points that count; if there is none, nothing changes. Priors weigh
  /// against the effective number of samples, (Σw)²/Σw², not their count: a bright particle among dim ones is one.
  void fit(std::span<const WeightedPoint> points);

  /// One sweep of on-line EM over new points.
  void update(std::span<const WeightedPoint> points);

  const Mixture& gaussians() const { return gaussians_; }  ///< weights sum to 1
  float background() const { return background_; }         ///< u in [0,1]
  long samplesSeen() const { return samples_; }
  /// u · 2cosθ/π + (1−u) · G(y), over the disc's area.
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
  double evidence_ = 0;  // effective samples so far, what priors weigh against
  long samples_ = 0;
};

}  // namespace lobe
