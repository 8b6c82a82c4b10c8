#include "fitter/lobe_fit.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "fitter/disc_mass.h"
#include "fitter/lobe_draws.h"
#include "fitter/low_discrepancy.h"
#include "fitter/nonlinear_fit.h"
#include "runtime/mixture/em.h"

namespace lobe {
namespace {

// The start covariance of every component, in units of the lobe's own.
constexpr float kStartScale = 0.5f;
// Floor of the components' variance, in units of the smaller variance of the lobe: no spikes on single points. The long
// tails of GGX make that variance a thousand times the peak's at grazing angles.
constexpr double kVarianceFloor = 1e-4;
// Single precision resolves the disc to about 1e-7.
constexpr double kSharpest = 1e-5;
// Weighted EM that only starts least squares need not converge.
constexpr int kStartSweeps = 15;
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
    const double dx = p.y.x() - x / weight, dy = p.y.y() - y / weight, share = p.weight / weight;
    spread.xx += share * dx * dx;
    spread.xy += share * dx * dy;
    spread.yy += share * dy * dy;
  }
  return spread;
}

/// The first points as means; the sequence is even, so they cover the lobe.
Mixture startMixture(const std::vector<WeightedPoint>& points, const Spread& spread, std::size_t components) {
  const std::size_t count = std::min(components, points.size());
  Covariance cov{kStartScale * static_cast<float>(spread.xx), kStartScale * static_cast<float>(spread.xy),
                 kStartScale * static_cast<float>(spread.yy)};
  Mixture mixture;
  for (std::size_t k = 0; k < count; ++k)
    mixture.push_back({1.0f / static_cast<float>(count), points[k].y.x(), points[k].y.y(), cov});
  return mixture;
}

/// Weighted EM, then merging.
Mixture expectationMaximised(const Lobe& lobe, const Vec3& wo, const std::vector<LobeDraw>& draws,
                             const FitSettings& settings) {
  if (draws.empty()) return {{1.0f, 0.0f, 0.0f, Covariance{kBroadVariance, 0.0f, kBroadVariance}}};
  const std::vector<WeightedPoint> points = weightedPoints(draws);
  Spread spread = spreadOf(points);
  if (points.size() < 3) spread = {kBroadVariance, 0, kBroadVariance};
  if (!(spread.smallerVariance() > kSharpest * kSharpest)) refuseLobe(lobe, wo, "it is too sharp, a mirror would do");
  Mixture mixture = startMixture(points, spread, settings.components);
  WeightedEmOptions options;
  options.minVariance = kVarianceFloor * spread.smallerVariance();
  if (settings.method != kMethodWem) options.maxSweeps = kStartSweeps;
  weightedEm(points, mixture, options);
  std::erase_if(mixture, [](const Gaussian& g) { return !(g.weight > 0); });
  if (settings.reduction > 0) reduce(mixture, settings.reduction);
  return mixture;
}

/// Weights that sum to one in single precision.
void normalise(Mixture& mixture) {
  double sum = 0;
  for (const Gaussian& g : mixture) sum += g.weight;
  for (Gaussian& g : mixture) g.weight = static_cast<float>(g.weight / sum);
}

/// p of Quality over solid angle, with dω = 2 dA.
class GradedDensity {
 public:
  GradedDensity(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture)
      : lobe_(lobe), wo_(wo), mixture_(mixture), cosineMass_(discMass(mixture).cosine) {}
  double cosineMass() const { return cosineMass_; }
  double operator()(const Vec3& wi, double ownPdf) const {
    const double guided = 0.5 * mixturePdf(mixture_, toDisc(wi)) * wi.z() / cosineMass_;
    return kDefensiveShare * ownPdf + (1 - kDefensiveShare) * guided;
  }
  double operator()(const Vec3& wi) const { return (*this)(wi, lobe_.pdf(wo_, wi)); }

 private:
  const Lobe& lobe_;
  const Vec3& wo_;
  std::span<const Gaussian> mixture_;
  double cosineMass_;
};

struct Moments {
  double first = 0, second = 0;
  double relativeVariance() const { return first > 0 ? std::max(0.0, second / (first * first) - 1) : 0; }
};

/// The largest of the ratios it is shown.
struct Worst {
  double ratio = 0;
  Vec3 wi = Vec3::UnitZ();
  void visit(double r, const Vec3& w) {
    if (r > ratio) ratio = r, wi = w;
  }
};

/// ∫ f and ∫ f²/p from points of G, times `share`. G is drawn in place of G cosθ/A and weighted by cosθ/A.
Moments fromMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture, const GradedDensity& p,
                    std::uint32_t samples, Worst& worst) {
  Moments sum;
  for (std::uint32_t i = 0; i < samples; ++i) {
    const Eigen::Vector3f u = cubePoint(i);
    const Vec2 y = sampleMixture(mixture, u.x(), u.tail<2>());
    if (!insideDisc(y)) continue;
    const Vec3 wi = fromDisc(y);
    const double density = p(wi);
    if (!(density > 0)) continue;
    const double ratio = lobeValue(lobe, wo, wi) * wi.z() / density, weight = wi.z() / p.cosineMass();
    worst.visit(ratio, wi);
    sum.first += weight * ratio / samples;
    sum.second += weight * ratio * ratio / samples;
  }
  return sum;
}

}  // namespace

void requireMethod(const std::string& method) {
  if (method == kMethodAuto || method == kMethodWem || method == kMethodCeres || method == kMethodEq8) return;
  throw std::runtime_error(fmt::format("--method must be {}, {}, {} or {}, not '{}'", kMethodAuto, kMethodWem,
                                       kMethodCeres, kMethodEq8, method));
}

Quality gradeMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture, std::uint32_t samples) {
  const GradedDensity p(lobe, wo, mixture);
  Worst worst;
  Moments own, covered;  // own: drawn from q as a part of p; covered: ∫ f and ∫ f²/p by importance sampling from q
  for (const LobeDraw& d : drawLobe(lobe, wo, samples, samples)) {
    const double f = d.value * d.wi.z(), ratio = f / p(d.wi, d.pdf);
    worst.visit(ratio, d.wi);
    own.first += ratio / samples;
    own.second += ratio * ratio / samples;
    covered.first += f / d.pdf / samples;
    covered.second += f * ratio / d.pdf / samples;
  }
  const Moments guided = fromMixture(lobe, wo, mixture, p, samples, worst);
  constexpr double beta = kDefensiveShare;
  const Moments drawn{beta * own.first + (1 - beta) * guided.first, beta * own.second + (1 - beta) * guided.second};
  const double worstRatio = drawn.first > 0 ? worst.ratio / drawn.first : 0;
  return {drawn.relativeVariance(), covered.relativeVariance(), worstRatio, worst.wi};
}

namespace {

struct Graded {
  Mixture mixture;
  Quality quality;
};

Graded graded(const Lobe& lobe, const Vec3& wo, Mixture mixture, std::uint32_t samples) {
  normalise(mixture);
  const Quality quality = gradeMixture(lobe, wo, mixture, samples);
  return {std::move(mixture), quality};
}

/// What the use of a fit is judged by. Each estimate alone may miss what its points miss.
double worse(const Quality& q) {
  return std::max(q.nev, q.coverage);
}

/// The start, refined when that makes it better.
Graded refined(const Lobe& lobe, const Vec3& wo, const Mixture& start, const FitSettings& settings) {
  Graded before = graded(lobe, wo, start, settings.samples);
  if (settings.method == kMethodWem) return before;
  NonlinearFitOptions options;
  if (settings.method == kMethodEq8) options.objective = FitObjective::reflectance;
  options.points = settings.samples / 2;
  Graded after = graded(lobe, wo, refineMixture(lobe, wo, before.mixture, options).mixture, settings.samples);
  return worse(after.quality) < worse(before.quality) ? after : before;
}

}  // namespace

FittedRecord fitLobe(const Lobe& lobe, const Vec3& wo, const FitSettings& settings, std::span<const Gaussian> start) {
  requireMethod(settings.method);
  const std::vector<LobeDraw> draws = drawLobe(lobe, wo, 0, settings.samples);
  const bool chained = !start.empty() && !draws.empty() && settings.method != kMethodWem;
  const Graded best =
      refined(lobe, wo, chained ? Mixture(start.begin(), start.end()) : expectationMaximised(lobe, wo, draws, settings),
              settings);
  FittedRecord fitted{best.mixture, {}};
  double integral = 0, albedo = 0;
  for (const LobeDraw& d : draws) {
    integral += d.value / d.pdf;
    albedo += d.value * d.wi.z() / d.pdf;
  }
  const DiscMass mass = discMass(fitted.mixture);
  CacheRecord& r = fitted.record;
  r.count = static_cast<std::uint32_t>(fitted.mixture.size());
  r.integral = static_cast<float>(integral / settings.samples);
  r.albedo = static_cast<float>(albedo / settings.samples);
  r.cosineMass = static_cast<float>(mass.cosine);
  r.outside = static_cast<float>(std::clamp(1 - mass.inside, 0.0, 1.0));
  r.nev = static_cast<float>(best.quality.nev);
  r.nevCoverage = static_cast<float>(best.quality.coverage);
  r.worstRatio = static_cast<float>(best.quality.worst);
  return fitted;
}

}  // namespace lobe
