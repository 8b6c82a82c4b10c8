#include "fitter/grade.h"

#include <algorithm>

#include "fitter/disc_mass.h"
#include "runtime/core/low_discrepancy.h"

namespace lobe {
namespace {

/// The density p of Quality over solid angle, with dω = 2 dA.
class GradedDensity {
 public:
  GradedDensity(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture)
      : lobe_(lobe), wo_(wo), mixture_(mixture), cosineMass_(discMass(mixture).cosine) {}
  double cosineMass() const { return cosineMass_; }
  double operator()(const Vec3& wi, double ownPdf) const {
    const double guided = 0.5 * mixturePdf(mixture_, toDisc(wi)) * wi.z() / cosineMass_;
    return kGradedBsdfFraction * ownPdf + (1 - kGradedBsdfFraction) * guided;
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

/// The largest ratio and its direction.
struct Worst {
  double ratio = 0;
  Vec3 wi = Vec3::UnitZ();
  void visit(double r, const Vec3& w) {
    if (r > ratio) ratio = r, wi = w;
  }
};

/// Estimates of ∫ f and ∫ f²/p with points from G, weighted by cosθ/A in place of points from G cosθ/A.
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

/// Estimates with points from q.
struct FromOwn {
  Moments drawn, coverage;  // ∫ f and ∫ f²/p: with q as one component of p; by importance sampling with q
  Worst worst;
};

FromOwn fromOwn(const std::vector<LobeDraw>& draws, const GradedDensity& p, std::uint32_t samples) {
  FromOwn own;
  for (const LobeDraw& d : draws) {
    const double f = d.value * d.wi.z(), ratio = f / p(d.wi, d.pdf);
    own.worst.visit(ratio, d.wi);
    own.drawn.first += ratio / samples;
    own.drawn.second += ratio * ratio / samples;
    own.coverage.first += f / d.pdf / samples;
    own.coverage.second += f * ratio / d.pdf / samples;
  }
  return own;
}

}  // namespace

Grader::Grader(const Lobe& lobe, const Vec3& wo, std::uint32_t samples)
    : lobe_(lobe), wo_(wo), samples_(samples), draws_(drawLobe(lobe, wo, samples, samples)) {}

Quality Grader::grade(std::span<const Gaussian> mixture) const {
  const GradedDensity p(lobe_, wo_, mixture);
  FromOwn own = fromOwn(draws_, p, samples_);
  const Moments guided = fromMixture(lobe_, wo_, mixture, p, samples_, own.worst);
  constexpr double beta = kGradedBsdfFraction;
  const Moments drawn{beta * own.drawn.first + (1 - beta) * guided.first,
                      beta * own.drawn.second + (1 - beta) * guided.second};
  const Worst& worst = own.worst;
  const double worstRatio = drawn.first > 0 ? worst.ratio / drawn.first : 0;
  return {drawn.relativeVariance(), own.coverage.relativeVariance(), worstRatio, worst.wi};
}

double Grader::coverage(std::span<const Gaussian> mixture) const {
  return fromOwn(draws_, GradedDensity(lobe_, wo_, mixture), samples_).coverage.relativeVariance();
}

Quality gradeMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture, std::uint32_t samples) {
  return Grader(lobe, wo, samples).grade(mixture);
}

}  // namespace lobe
