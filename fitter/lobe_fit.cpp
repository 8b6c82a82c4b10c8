#include "fitter/lobe_fit.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "fitter/disc_mass.h"
#include "fitter/lobe_draws.h"
#include "fitter/nonlinear_fit.h"
#include "runtime/core/low_discrepancy.h"
#include "runtime/mixture/em.h"

namespace lobe {
namespace {

// Initial covariance of every component, relative to the covariance of the lobe.
constexpr float kStartScale = 0.5f;
// Lower bound of the components' variance, relative to the smaller variance of the lobe, to prevent spikes on single
// points. At grazing angles the long tails of GGX make the variance of the lobe a thousand times that of its peak.
constexpr double kVarianceFloor = 1e-4;
// Smallest standard deviation; single precision resolves about 1e-7 on the disc.
constexpr double kSharpest = 1e-5;
// When weighted EM only provides the start of least squares, it need not converge or use all points.
constexpr int kStartSweeps = 15;
constexpr std::size_t kStartFraction = 4;
constexpr float kBroadVariance = 0.25f;

std::vector<WeightedPoint> weightedPoints(const std::vector<LobeDraw>& draws) {
  std::vector<WeightedPoint> points;
  points.reserve(draws.size());
  for (const LobeDraw& d : draws) points.push_back({toDisc(d.wi), static_cast<float>(d.value / d.pdf)});
  return points;
}

struct Spread {
  double xx = 0, xy = 0, yy = 0;
  double smallerVariance() const { return 0.5 * (xx + yy) - std::hypot(0.5 * (xx - yy), xy); }
};

Spread spreadOf(const std::vector<WeightedPoint>& points) {
  double weight = 0, x = 0, y = 0;
  for (const WeightedPoint& p : points) weight += p.weight, x += p.weight * p.y.x(), y += p.weight * p.y.y();
  Spread spread;
  for (const WeightedPoint& p : points) {
    const double dx = p.y.x() - x / weight, dy = p.y.y() - y / weight, fraction = p.weight / weight;
    spread.xx += fraction * dx * dx;
    spread.xy += fraction * dx * dy;
    spread.yy += fraction * dy * dy;
  }
  return spread;
}

/// Uses the first points as means; the sequence is low-discrepancy, so they cover the lobe.
Mixture startMixture(const std::vector<WeightedPoint>& points, const Spread& spread, std::size_t components) {
  const std::size_t count = std::min(components, points.size());
  Covariance cov{kStartScale * static_cast<float>(spread.xx), kStartScale * static_cast<float>(spread.xy),
                 kStartScale * static_cast<float>(spread.yy)};
  Mixture mixture;
  for (std::size_t k = 0; k < count; ++k)
    mixture.push_back({1.0f / static_cast<float>(count), points[k].y.x(), points[k].y.y(), cov});
  return mixture;
}

/// Makes the weights sum to one in single precision.
void normalise(Mixture& mixture) {
  double sum = 0;
  for (const Gaussian& g : mixture) sum += g.weight;
  for (Gaussian& g : mixture) g.weight = static_cast<float>(g.weight / sum);
}

}  // namespace

struct DirectionFitter::Graded {
  Mixture mixture;
  Quality quality;
};

DirectionFitter::DirectionFitter(const Lobe& lobe, const Vec3& wo, std::uint32_t samples)
    : lobe_(lobe), wo_(wo), samples_(samples), draws_(drawLobe(lobe, wo, 0, samples)), grader_(lobe, wo, samples) {}

/// Weighted EM, then merging.
Mixture DirectionFitter::expectationMaximised(const FitSettings& settings) const {
  if (draws_.empty()) return {{1.0f, 0.0f, 0.0f, Covariance{kBroadVariance, 0.0f, kBroadVariance}}};
  std::vector<WeightedPoint> points = weightedPoints(draws_);
  Spread spread = spreadOf(points);
  if (points.size() < 3) spread = {kBroadVariance, 0, kBroadVariance};
  if (!(spread.smallerVariance() > kSharpest * kSharpest))
    throw TooNarrow(faultOfLobe(lobe_, wo_, "it is too narrow for Gaussians"));
  Mixture mixture = startMixture(points, spread, settings.components);
  WeightedEmOptions options;
  options.minVariance = kVarianceFloor * spread.smallerVariance();
  if (settings.method != FitMethod::wem) {
    options.maxSweeps = kStartSweeps;
    points.resize((points.size() + kStartFraction - 1) / kStartFraction);
  }
  weightedEm(points, mixture, options);
  std::erase_if(mixture, [](const Gaussian& g) { return !(g.weight > 0); });
  if (settings.reduction > 0) reduce(mixture, settings.reduction);
  return mixture;
}

DirectionFitter::Graded DirectionFitter::graded(Mixture mixture) const {
  const Quality quality = grader_.grade(mixture);
  return {std::move(mixture), quality};
}

/// Refines the start by least squares; returns the better of the two.
DirectionFitter::Graded DirectionFitter::refined(const Mixture& start, const FitSettings& settings) const {
  NonlinearFitOptions options;
  if (settings.method == FitMethod::eq8) options.objective = FitObjective::reflectance;
  options.points = samples_ / 2;
  Mixture mixture = refineMixture(lobe_, wo_, start, options).mixture;
  normalise(mixture);
  Graded after = graded(std::move(mixture));
  // The coverage is a lower bound of the start's grade and is cheap to compute.
  if (after.quality.largerVariance() < grader_.coverage(start)) return after;
  Graded before = graded(start);
  return after.quality.largerVariance() < before.quality.largerVariance() ? after : before;
}

FittedRecord DirectionFitter::record(Graded best) const {
  FittedRecord fitted{std::move(best.mixture), {}};
  double integral = 0, albedo = 0;
  for (const LobeDraw& d : draws_) {
    integral += d.value / d.pdf;
    albedo += d.value * d.wi.z() / d.pdf;
  }
  const DiscMass mass = discMass(fitted.mixture);
  CacheRecord& r = fitted.record;
  r.count = static_cast<std::uint32_t>(fitted.mixture.size());
  r.integral = static_cast<float>(integral / samples_);
  r.albedo = static_cast<float>(albedo / samples_);
  r.cosineMass = static_cast<float>(mass.cosine);
  r.outside = static_cast<float>(std::clamp(1 - mass.inside, 0.0, 1.0));
  r.nev = static_cast<float>(best.quality.nev);
  r.nevCoverage = static_cast<float>(best.quality.coverage);
  r.worstRatio = static_cast<float>(best.quality.worst);
  return fitted;
}

FittedRecord DirectionFitter::fit(const FitSettings& settings, std::span<const Gaussian> start) const {
  const bool wem = settings.method == FitMethod::wem, chained = !start.empty() && !draws_.empty() && !wem;
  Mixture mixture = chained ? Mixture(start.begin(), start.end()) : expectationMaximised(settings);
  normalise(mixture);
  return record(wem ? graded(std::move(mixture)) : refined(mixture, settings));
}

FittedRecord withoutComponents(const Lobe& lobe, const Vec3& wo, std::uint32_t samples) {
  FittedRecord fitted{{}, {}};
  for (const LobeDraw& d : drawLobe(lobe, wo, 0, samples)) {
    fitted.record.integral += static_cast<float>(d.value / d.pdf / samples);
    fitted.record.albedo += static_cast<float>(d.value * d.wi.z() / d.pdf / samples);
  }
  return fitted;
}

FittedRecord fitLobe(const Lobe& lobe, const Vec3& wo, const FitSettings& settings, std::span<const Gaussian> start) {
  return DirectionFitter(lobe, wo, settings.samples).fit(settings, start);
}

}  // namespace lobe
