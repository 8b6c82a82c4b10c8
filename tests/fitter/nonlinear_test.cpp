#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "fitter/adaptive_fit.h"
#include "fitter/compile.h"
#include "fitter/disc_mass.h"
#include "fitter/mass_slopes.h"
#include "fitter/nonlinear_fit.h"
#include "tests/support/fitter_test_lobes.h"

using namespace lobe;

namespace {

/// A lobe whose values are a mixture over the disc. Its sampler is the mixture or uniform over the hemisphere; its
/// values may be multiplied by noise between 0 and 2, or all be zero.
class MixtureLobe : public Lobe {
 public:
  enum class Values { exact, noisy, black };
  explicit MixtureLobe(Mixture mixture, Values values = Values::exact, bool uniform = false)
      : mixture_(std::move(mixture)), values_(values), uniform_(uniform) {}
  LobeKind kind() const override { return LobeKind::isotropic; }
  std::string model() const override { return "test"; }
  std::string key() const override { return "test"; }
  std::string summary() const override { return "a test lobe"; }
  int revision() const override { return 1; }
  double eval(const Vec3&, const Vec3& wi) const override {
    if (wi.z() <= 0 || values_ == Values::black) return 0;
    return 0.5 * mixturePdf(mixture_, toDisc(wi)) * (values_ == Values::noisy ? noise(wi) : 1);
  }
  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const override {
    Vec2 y;
    if (uniform_) {
      const float r = std::sqrt(u.x()), phi = 6.2831853f * u.y();
      y = {r * std::cos(phi), r * std::sin(phi)};
    } else {
      const float scaled = 4096 * u.x();
      y = sampleMixture(mixture_, u.y(), {scaled - std::floor(scaled), u.x()});
    }
    if (!insideDisc(y)) return std::nullopt;
    const Vec3 wi = fromDisc(y);
    return LobeSample{wi, pdf(wo, wi)};
  }
  float pdf(const Vec3&, const Vec3& wi) const override {
    if (wi.z() <= 0) return 0;
    return uniform_ ? 0.15915494f : 0.5f * mixturePdf(mixture_, toDisc(wi));
  }

 private:
  static double noise(const Vec3& wi) {
    const double s = 43758.5453 * std::sin(12.9898 * wi.x() + 78.233 * wi.y());
    return 2 * (s - std::floor(s));
  }
  Mixture mixture_;
  Values values_;
  bool uniform_;
};

const Mixture kTwoLobes{{0.3f, -0.6f, 0.1f, {0.01f, 0.004f, 0.02f}}, {0.7f, 0.5f, -0.3f, {0.003f, 0, 0.006f}}};

FitSettings settingsFor(FitMethod method, std::uint32_t components = 8, std::uint32_t samples = 4096) {
  FitSettings settings;
  settings.method = method;
  settings.components = components;
  settings.samples = samples;
  settings.reduction = 0;
  return settings;
}

double squares(const FitResiduals& residuals, const Eigen::VectorXd& parameters) {
  Eigen::VectorXd values(residuals.NumResiduals());
  residuals(parameters.data(), values.data(), nullptr);
  return values.squaredNorm();
}

/// Largest difference between the Jacobian and central differences, relative to the largest entry.
double jacobianError(const FitResiduals& residuals, const Eigen::VectorXd& parameters) {
  Eigen::MatrixXd jacobian(residuals.NumResiduals(), residuals.NumParameters());
  Eigen::VectorXd values(residuals.NumResiduals()), above = values, below = values;
  residuals(parameters.data(), values.data(), jacobian.data());
  double error = 0;
  for (Eigen::Index i = 0; i < parameters.size(); ++i) {
    constexpr double kStep = 1e-5;
    Eigen::VectorXd moved = parameters;
    moved[i] += kStep;
    residuals(moved.data(), above.data(), nullptr);
    moved[i] -= 2 * kStep;
    residuals(moved.data(), below.data(), nullptr);
    const Eigen::VectorXd difference = (above - below) / (2 * kStep) - jacobian.col(i);
    error = std::max(error, difference.cwiseAbs().maxCoeff());
  }
  return error / jacobian.cwiseAbs().maxCoeff();
}

Eigen::Matrix2d lowerOf(const Covariance& c) {
  Eigen::Matrix2d v;
  v << c.xx, c.xy, c.xy, c.yy;
  return v.llt().matrixL();
}

MassSlopes slopesOf(const Gaussian& g) {
  return massSlopes({g.meanX, g.meanY}, lowerOf(g.cov));
}

}  // namespace

TEST_CASE("fitter: derivatives of the mass on the disc agree with finite differences") {
  const Gaussian cases[] = {{1, 0.1f, 0, {0.004f, 0, 0.004f}},
                            {1, 0.95f, 0, {0.01f, 0, 0.1f}},
                            {1, 0.6f, 0.6f, {0.3f, -0.2f, 0.4f}},
                            {1, -0.9f, 0.1f, {0.1f, 0, 0.004f}}};
  for (const Gaussian& g : cases) {
    CAPTURE(g.meanX, g.meanY);
    const MassSlopes s = slopesOf(g);
    const DiscMass mass = discMass(std::span(&g, 1));
    CHECK(s.inside.value == Approx(mass.inside).margin(1e-4));
    CHECK(s.cosine.value == Approx(mass.cosine).margin(1e-4));
    const auto check = [&](const Gaussian& above, const Gaussian& below, double step, const auto& slope) {
      const MassSlopes a = slopesOf(above), b = slopesOf(below);
      CHECK(slope(s.inside) == Approx((a.inside.value - b.inside.value) / step).margin(0.01));
      CHECK(slope(s.cosine) == Approx((a.cosine.value - b.cosine.value) / step).margin(0.01));
    };
    constexpr float kStep = 2e-4f;
    Gaussian above = g, below = g;
    above.meanX += kStep, below.meanX -= kStep;
    check(above, below, 2 * kStep, [](const MassSlope& m) { return m.byMean.x(); });
    above = below = g, above.cov.yy *= 1.01f, below.cov.yy *= 0.99f;
    check(above, below, above.cov.yy - below.cov.yy, [](const MassSlope& m) { return m.byCov(1, 1); });
    above = below = g, above.cov.xy += kStep, below.cov.xy -= kStep;
    check(above, below, 2 * kStep, [](const MassSlope& m) { return 2 * m.byCov(0, 1); });
  }
}

TEST_CASE("fitter: derivatives of the residuals agree with finite differences") {
  for (const double elevation : {20.0, 70.0, 89.0}) {
    for (const FitObjective objective : {FitObjective::product, FitObjective::reflectance}) {
      const LobePtr lobe = conductorLobe(0.1, 0.3);
      const Vec3 wo = direction(elevation, 25);
      const Mixture start = fitLobe(*lobe, wo, settingsFor(FitMethod::wem, 4)).mixture;
      NonlinearFitOptions options;
      options.objective = objective;
      options.points = 512;
      const FitPoints points = fitPoints(*lobe, wo, start, options);
      CAPTURE(elevation, static_cast<int>(objective));
      CHECK(jacobianError(FitResiduals(objective, points, start.size()), toParameters(start, points.whitening)) < 1e-4);
    }
  }
}

TEST_CASE("fitter: a mixture survives conversion to parameters and back") {
  Whitening whitening;
  whitening.centre = {-0.4, 0.1};
  whitening.factor << 0.3, 0, 0.05, 0.2;
  Mixture mixture = kTwoLobes;
  mixture.push_back({0.0f, -0.97f, 0.1f, {0.1f, 0, 0.2f}});
  const Eigen::VectorXd p = toParameters(mixture, whitening);
  const Mixture back = toMixture(fromParameters({p.data(), static_cast<std::size_t>(p.size())}, whitening), whitening);
  for (std::size_t k = 0; k < mixture.size(); ++k) {
    CHECK(back[k].weight == Approx(mixture[k].weight).margin(2e-6));
    CHECK((back[k].mean() - mixture[k].mean()).norm() < 1e-6f);
    CHECK(back[k].cov.xx == Approx(mixture[k].cov.xx).epsilon(1e-4));
    CHECK(back[k].cov.xy == Approx(mixture[k].cov.xy).margin(1e-6));
    CHECK(back[k].cov.yy == Approx(mixture[k].cov.yy).epsilon(1e-4));
  }
}

TEST_CASE("fitter: least squares recovers a lobe that is a mixture") {
  const MixtureLobe lobe(kTwoLobes);
  Mixture start = kTwoLobes;
  start[0].meanX += 0.1f, start[0].weight = 0.5f, start[1].cov.xx *= 3, start[1].meanY += 0.05f;
  for (const FitObjective objective : {FitObjective::product, FitObjective::reflectance}) {
    NonlinearFitOptions options;
    options.objective = objective;
    const NonlinearFit fit = refineMixture(lobe, direction(30), start, options);
    CAPTURE(static_cast<int>(objective));
    CHECK(fit.startCost > 0.1);
    CHECK(fit.cost < 0.01);  // not 0: the BSDF part of the density (a tenth) has no cosine
    CHECK(fit.mixture[0].weight == Approx(0.3).margin(0.01));
    CHECK((fit.mixture[0].mean() - kTwoLobes[0].mean()).norm() < 0.01f);
    CHECK(fit.mixture[1].cov.xx == Approx(0.003).margin(2e-4));
  }
}

TEST_CASE("fitter: Eq. 8 is evaluated in one measure unlike its printed form") {
  const LobePtr lobe = conductorLobe(0.2, 0.2);
  const Vec3 wo = direction(40);
  NonlinearFitOptions options;
  options.objective = FitObjective::reflectance;
  const Mixture start = fitLobe(*lobe, wo, settingsFor(FitMethod::wem)).mixture;
  const Mixture fit = refineMixture(*lobe, wo, start, options).mixture;
  FitPoints points = fitPoints(*lobe, wo, fit, options);
  // Σ (1 − r/s)², where s is the sum of unnormalised weights, is minimal at s = Σ r² / Σ r.
  const auto bestSum = [&] {
    double first = 0, second = 0;
    for (Eigen::Index i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d y =
          points.whitening.centre + points.whitening.factor * Eigen::Vector2d(points.x[i], points.y[i]);
      const double r = points.target[i] / mixturePdf(fit, y.cast<float>());
      first += r, second += r * r;
    }
    return second / first;
  };
  const Eigen::VectorXd parameters = toParameters(fit, points.whitening);
  const FitResiduals residuals(options.objective, points, fit.size());
  CHECK(bestSum() == Approx(1).margin(0.1));
  CHECK(squares(residuals, parameters) < 0.05);
  points.target *= 0.5;  // as printed: ρ̂ over solid angle against G over the disc
  CHECK(bestSum() == Approx(0.5).margin(0.05));
  CHECK(squares(residuals, parameters) > 0.2);
}

TEST_CASE("fitter: the objective of the product is the relative variance of the grade") {
  const LobePtr lobe = conductorLobe(0.2, 0.2);
  const Vec3 wo = direction(60);
  const Mixture start = fitLobe(*lobe, wo, settingsFor(FitMethod::wem, 2)).mixture;
  const NonlinearFit fit = refineMixture(*lobe, wo, start);
  CHECK(fit.startCost == Approx(gradeMixture(*lobe, wo, start, 8192).nev).margin(0.01));
  CHECK(fit.cost == Approx(gradeMixture(*lobe, wo, fit.mixture, 8192).nev).margin(0.01));
  CHECK(fit.cost < 0.7 * fit.startCost);
}

TEST_CASE("fitter: least squares improves on weighted EM at every elevation") {
  for (const auto& [alphaU, alphaV, distribution] :
       {std::tuple(0.02, 0.02, "ggx"), std::tuple(0.1, 0.1, "ggx"), std::tuple(0.5, 0.5, "ggx"),
        std::tuple(0.05, 0.05, "beckmann"), std::tuple(0.05, 0.2, "ggx")}) {
    const LobePtr lobe = conductorLobe(alphaU, alphaV, distribution);
    for (const double elevation : {2.0, 50.0, 75.0, 88.0}) {
      const Vec3 wo = direction(elevation, 20);
      const CacheRecord wem = fitLobe(*lobe, wo, settingsFor(FitMethod::wem)).record;
      const FittedRecord fit = fitLobe(*lobe, wo, settingsFor(FitMethod::ceres));
      CAPTURE(alphaU, alphaV, distribution, elevation);
      checkSound(fit);
      CHECK(fit.record.nevCoverage < wem.nevCoverage);
      CHECK(fit.record.nevCoverage < 0.05f);
    }
  }
}

TEST_CASE("fitter: least squares fits are valid at every elevation and roughness") {
  for (const FitMethod method : {FitMethod::ceres, FitMethod::eq8}) {
    for (const double alpha : {0.001, 0.05, 1.0}) {
      for (const double elevation : {0.0, 20.0, 89.0, 89.99}) {
        CAPTURE(method, alpha, elevation);
        checkSound(fitLobe(*conductorLobe(alpha, alpha), direction(elevation), settingsFor(method, 8, 1024)));
      }
    }
    checkSound(fitLobe(*conductorLobe(0.01, 1.0), direction(80, 45), settingsFor(method, 8, 1024)));
    checkSound(fitLobe(*conductorLobe(1.0, 0.01), direction(0.01, 10), settingsFor(method, 8, 1024)));
  }
}

TEST_CASE("fitter: least squares fits are valid for few samples or components and for unusual lobes") {
  const Vec3 wo = direction(60);
  const Vec2 back = toDisc(wo);
  const Mixture retro{{1, back.x(), back.y(), {0.002f, 0, 0.002f}}};
  using Values = MixtureLobe::Values;
  const MixtureLobe lobes[] = {MixtureLobe(retro), MixtureLobe(kTwoLobes), MixtureLobe(kTwoLobes, Values::exact, true),
                               MixtureLobe(kTwoLobes, Values::noisy), MixtureLobe(kTwoLobes, Values::black)};
  for (const FitMethod method : {FitMethod::ceres, FitMethod::eq8}) {
    for (const std::uint32_t components : {1u, 8u}) {
      for (const std::uint32_t samples : {16u, 1024u}) {
        CAPTURE(method, components, samples);
        checkSound(fitLobe(*conductorLobe(0.2, 0.2), direction(89.9), settingsFor(method, components, samples)));
        for (const MixtureLobe& lobe : lobes) checkSound(fitLobe(lobe, wo, settingsFor(method, components, samples)));
      }
    }
  }
  CHECK(fitLobe(lobes[0], wo, settingsFor(FitMethod::ceres)).record.nev < 0.01f);
  // A tenth of the samples is lost to the uniform BSDF sampler.
  CHECK(fitLobe(lobes[2], wo, settingsFor(FitMethod::ceres)).record.nevCoverage < 1 / 0.9f - 1);
  CHECK(fitLobe(lobes[4], wo, settingsFor(FitMethod::ceres)).record.integral == 0);
}

TEST_CASE("fitter: adaptive fits are valid for few samples and for unusual and extreme lobes") {
  const Vec3 wo = direction(60);
  const Vec2 back = toDisc(wo);
  const Mixture retro{{1, back.x(), back.y(), {0.002f, 0, 0.002f}}};
  using Values = MixtureLobe::Values;
  const MixtureLobe lobes[] = {MixtureLobe(retro), MixtureLobe(kTwoLobes), MixtureLobe(kTwoLobes, Values::noisy, true),
                               MixtureLobe(kTwoLobes, Values::black)};
  for (const std::uint32_t components : {1u, 8u}) {
    for (const std::uint32_t samples : {16u, 1024u}) {
      FitSettings settings = settingsFor(FitMethod::automatic, components, samples);
      settings.quality = 0.03f;
      CAPTURE(components, samples);
      for (const MixtureLobe& lobe : lobes) checkSound(fitWithFewest(lobe, wo, settings));
      for (const double alpha : {0.001, 0.05, 1.0})
        for (const double elevation : {0.0, 89.99})
          checkSound(fitWithFewest(*conductorLobe(alpha, alpha), direction(elevation), settings));
      checkSound(fitWithFewest(*conductorLobe(0.01, 1.0), direction(80, 45), settings));
      for (const GridKind kind : {GridKind::elevation, GridKind::fibonacci})
        CHECK(fitGrid(lobes[1], {kind, 1}, settings).records.size() == 1);
    }
  }
}

TEST_CASE("fitter: a fit that starts from a neighbour keeps the order of its components") {
  const LobePtr lobe = conductorLobe(0.2, 0.2);
  const Mixture first = fitLobe(*lobe, direction(50), settingsFor(FitMethod::ceres, 4)).mixture;
  const FittedRecord next = fitLobe(*lobe, direction(51), settingsFor(FitMethod::ceres, 4), first);
  REQUIRE(next.mixture.size() == first.size());
  for (std::size_t k = 0; k < first.size(); ++k) {
    CHECK(next.mixture[k].weight == Approx(first[k].weight).margin(0.1));
    CHECK((next.mixture[k].mean() - first[k].mean()).norm() < 0.1f);
  }
  CHECK(next.record.nevCoverage < 0.05f);
}

TEST_CASE("fitter: grids of both kinds are fitted along chains") {
  for (const DirectionGrid& grid : {DirectionGrid{GridKind::elevation, 20}, DirectionGrid{GridKind::fibonacci, 60}}) {
    const LobePtr lobe = conductorLobe(0.1, grid.kind == GridKind::elevation ? 0.1 : 0.3);
    const FittedGrid fit = fitGrid(*lobe, grid, settingsFor(FitMethod::ceres, 8, 2048));
    REQUIRE(fit.records.size() == static_cast<std::size_t>(grid.count));
    for (const CacheRecord& r : fit.records) CHECK(r.nevCoverage < 0.08f);
  }
}

TEST_CASE("fitter: least squares over a grid is never worse than weighted EM") {
  const DirectionGrid grid{GridKind::elevation, 12};
  for (const char* distribution : {"ggx", "beckmann"}) {
    for (const double alpha : {0.02, 0.05, 0.1, 0.2, 0.3, 0.5}) {
      const LobePtr lobe = conductorLobe(alpha, alpha, distribution);
      const FittedGrid wem = fitGrid(*lobe, grid, settingsFor(FitMethod::wem, 8, 512));
      const FittedGrid fit = fitGrid(*lobe, grid, settingsFor(FitMethod::ceres, 8, 512));
      for (std::size_t i = 0; i < fit.records.size(); ++i) {
        const CacheRecord &a = fit.records[i], &b = wem.records[i];
        CAPTURE(distribution, alpha, i);
        CHECK(std::max(a.nev, a.nevCoverage) <= std::max(b.nev, b.nevCoverage));
      }
    }
  }
}

TEST_CASE("fitter: fit methods convert to names and back") {
  for (const char* name : kFitMethodNames) CHECK(nameOf(fitMethodOf(name).value()) == std::string(name));
  CHECK(!fitMethodOf("magic"));
}
