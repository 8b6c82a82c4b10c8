#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "fitter/cache_mixture.h"
#include "fitter/compile.h"
#include "fitter/disc_mass.h"
#include "fitter/lobe_fit.h"
#include "runtime/mixture/lookup.h"
#include "tests/support/fitter_test_lobes.h"

using namespace lobe;

namespace {

/// ∫ f(y, wi) dA over the disc by the midpoint rule on a square grid; independent of the fitter but for the disc map.
template <class F>
double discIntegral(int resolution, const F& f) {
  double sum = 0;
  const double step = 2.0 / resolution;
  for (int i = 0; i < resolution; ++i) {
    for (int j = 0; j < resolution; ++j) {
      const Vec2 y(static_cast<float>(-1 + (i + 0.5) * step), static_cast<float>(-1 + (j + 0.5) * step));
      if (insideDisc(y)) sum += f(y, fromDisc(y));
    }
  }
  return sum * step * step;
}

/// A constant over the hemisphere, or over a small circle about (0.3, 0) on the disc.
class TestLobe : public Lobe {
 public:
  /// Its radius on the disc is grazingRadius for directions more than 60° from the normal; 0: the same.
  explicit TestLobe(double value, bool samples = true, float radius = 1, float grazingRadius = 0)
      : value_(value), samples_(samples), radius_(radius), grazingRadius_(grazingRadius > 0 ? grazingRadius : radius) {}
  LobeKind kind() const override { return LobeKind::isotropic; }
  std::string model() const override { return "test"; }
  std::string key() const override { return "test"; }
  std::string summary() const override { return "a test lobe"; }
  int revision() const override { return 1; }
  double eval(const Vec3& wo, const Vec3& wi) const override { return pdf(wo, wi) > 0 ? value_ : 0; }
  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const override {
    if (!samples_) return std::nullopt;
    const float r = radius(wo) * std::sqrt(u.x()), phi = 6.2831853f * u.y();
    const Vec3 wi = fromDisc(centre() + r * Vec2(std::cos(phi), std::sin(phi)));
    return LobeSample{wi, pdf(wo, wi)};
  }
  float pdf(const Vec3& wo, const Vec3& wi) const override {
    // The factor allows for rounding of directions.
    const bool inside = wi.z() > 0 && (toDisc(wi) - centre()).norm() < 1.1f * radius(wo);
    return inside ? 0.15915494f / (radius(wo) * radius(wo)) : 0;
  }

 private:
  Vec2 centre() const { return radius_ < 1 ? Vec2(0.3f, 0) : Vec2(0, 0); }
  float radius(const Vec3& wo) const { return wo.z() < 0.5f ? grazingRadius_ : radius_; }
  double value_;
  bool samples_;
  float radius_, grazingRadius_;
};

}  // namespace

TEST_CASE("fitter: mass on the disc by quadrature in one dimension agrees with quadrature in two") {
  const Gaussian cases[] = {{1, 0, 0, {0.01f, 0, 0.01f}},         {1, -0.7f, 0.2f, {0.02f, 0.005f, 0.03f}},
                            {1, 0.95f, 0, {0.01f, 0, 0.1f}},      {1, 0.6f, 0.6f, {0.3f, -0.2f, 0.4f}},
                            {1, -0.98f, 0.1f, {0.2f, 0, 0.002f}}, {1, 1.2f, 0.1f, {0.1f, 0.02f, 0.05f}}};
  for (const Gaussian& g : cases) {
    const DiscMass mass = discMass(std::span(&g, 1));
    const double inside = discIntegral(1200, [&](const Vec2& y, const Vec3&) { return normalPdf(g, y); });
    const double cosine = discIntegral(1200, [&](const Vec2& y, const Vec3& w) { return normalPdf(g, y) * w.z(); });
    CHECK(mass.inside == Approx(inside).margin(2e-3));
    CHECK(mass.cosine == Approx(cosine).margin(1e-4));
  }
}

TEST_CASE("fitter: mass on the disc is linear in the weight and agrees with closed forms") {
  const Gaussian narrow{0.25f, 0.3f, -0.4f, {1e-4f, 2e-5f, 3e-4f}};
  const DiscMass one = discMass(std::span(&narrow, 1));
  CHECK(one.inside == Approx(0.25).epsilon(1e-9));
  CHECK(one.cosine == Approx(0.25 * (1 - 0.09 - 0.16 - 4e-4)).epsilon(1e-6));  // E|y|² = |μ|² + tr Σ
  // For an isotropic Gaussian at the centre, the mass inside is 1 − exp(−1/2σ²).
  const Gaussian round{1, 0, 0, {0.25f, 0, 0.25f}};
  CHECK(discMass(std::span(&round, 1)).inside == Approx(1 - std::exp(-2.0)).epsilon(1e-9));
}

TEST_CASE("fitter: integral and albedo and cosine mass agree with quadrature over the disc") {
  for (const double alpha : {0.15, 0.4}) {
    for (const double elevation : {5.0, 50.0, 80.0}) {
      const LobePtr lobe = conductorLobe(alpha, alpha);
      const Vec3 wo = direction(elevation, 30);
      const FittedRecord fit = fitLobe(*lobe, wo, {});
      CAPTURE(alpha, elevation);
      CHECK(fit.record.integral ==
            Approx(2 * discIntegral(1000, [&](const Vec2&, const Vec3& wi) { return lobe->eval(wo, wi); }))
                .epsilon(0.02));
      CHECK(fit.record.albedo ==
            Approx(2 * discIntegral(1000, [&](const Vec2&, const Vec3& wi) { return lobe->eval(wo, wi) * wi.z(); }))
                .epsilon(0.01));
      const auto cosine = [&](const Vec2& y, const Vec3& wi) { return mixturePdf(fit.mixture, y) * wi.z(); };
      CHECK(fit.record.cosineMass == Approx(discIntegral(1000, cosine)).epsilon(1e-3));
      const auto density = [&](const Vec2& y, const Vec3&) { return mixturePdf(fit.mixture, y); };
      CHECK(fit.record.outside == Approx(1 - discIntegral(1000, density)).margin(2e-3));
    }
  }
}

TEST_CASE("fitter: both estimates of the relative variance agree with quadrature") {
  for (const double elevation : {10.0, 60.0, 85.0}) {
    const LobePtr lobe = conductorLobe(0.3, 0.3);
    const Vec3 wo = direction(elevation);
    FitSettings settings;
    settings.components = 2;  // a poor fit, so that the relative variance is well above zero
    const FittedRecord fit = fitLobe(*lobe, wo, settings);
    const double mass =
        discIntegral(1000, [&](const Vec2& y, const Vec3& wi) { return mixturePdf(fit.mixture, y) * wi.z(); });
    const double mean =
        2 * discIntegral(1000, [&](const Vec2&, const Vec3& wi) { return lobe->eval(wo, wi) * wi.z(); });
    const double square = 2 * discIntegral(1000, [&](const Vec2& y, const Vec3& wi) {
                            const double f = lobe->eval(wo, wi) * wi.z();
                            const double p =
                                0.1 * lobe->pdf(wo, wi) + 0.9 * mixturePdf(fit.mixture, y) * wi.z() / mass / 2;
                            return p > 0 ? f * f / p : 0;
                          });
    CAPTURE(elevation);
    CHECK(fit.record.nev == Approx(square / (mean * mean) - 1).margin(0.02));
    CHECK(fit.record.nevCoverage == Approx(square / (mean * mean) - 1).margin(0.02));
  }
}

TEST_CASE("fitter: weighted EM reaches the expected relative variance for GGX") {
  // Medians over elevation of the relative variance of ρ cosθ with the defensive density.
  for (const auto& [alpha, bound] : {std::pair(0.1, 0.142), std::pair(0.3, 0.2)}) {
    const LobePtr lobe = conductorLobe(alpha, alpha);
    std::vector<float> nev;
    for (const double elevation : {3.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0}) {
      const FittedRecord fit = fitLobe(*lobe, direction(elevation), {});
      CHECK(fit.record.nevCoverage < 2 * bound);
      nev.push_back(fit.record.nev);
    }
    std::ranges::sort(nev);
    CAPTURE(alpha);
    CHECK(nev[3] < bound / 2);
    CHECK(nev.back() < bound);
  }
}

TEST_CASE("fitter: mixtures are fitted without the cosine") {
  // A constant ρ is flat over the disc, so the mixture's mean cosine is that of the disc, ½; with the cosine in the fit
  // it would be ⅔.
  const FittedRecord fit = fitLobe(TestLobe(0.3), direction(20), {});
  const DiscMass mass = discMass(fit.mixture);
  CHECK(mass.cosine / mass.inside == Approx(0.5).margin(0.08));
  CHECK(fit.record.integral == Approx(0.3 * 2 * std::numbers::pi).epsilon(1e-4));
  CHECK(fit.record.albedo == Approx(0.3 * std::numbers::pi).epsilon(1e-3));
}

TEST_CASE("fitter: fits are valid at every elevation and roughness") {
  FitSettings settings;
  settings.samples = 1024;
  for (const double alpha : {0.001, 0.01, 0.05, 0.2, 0.5, 1.0}) {
    for (const double elevation : {0.0, 0.01, 20.0, 70.0, 89.0, 89.9, 89.99}) {
      CAPTURE(alpha, elevation);
      checkSound(fitLobe(*conductorLobe(alpha, alpha), direction(elevation), settings));
    }
  }
  checkSound(fitLobe(*conductorLobe(0.02, 0.5), direction(80, 45), settings));
  checkSound(fitLobe(*conductorLobe(0.02, 0.02, "beckmann"), direction(89.9), settings));
}

TEST_CASE("fitter: fits with few samples or one component are valid") {
  for (const std::uint32_t components : {1u, 8u, 32u}) {
    FitSettings settings;
    settings.components = components;
    settings.samples = 16;
    settings.reduction = 0;
    const FittedRecord fit = fitLobe(*conductorLobe(0.2, 0.2), direction(89.9), settings);
    checkSound(fit);
    CHECK(fit.mixture.size() <= components);
  }
}

TEST_CASE("fitter: merging reduces the number of components") {
  FitSettings all, some;
  all.reduction = 0;
  some.reduction = 0.2f;
  const LobePtr lobe = conductorLobe(0.1, 0.1);
  CHECK(fitLobe(*lobe, direction(40), all).mixture.size() == 8);
  CHECK(fitLobe(*lobe, direction(40), some).mixture.size() < 7);
}

TEST_CASE("fitter: lobes without reflectance get one record without components") {
  const DirectionGrid grid{GridKind::elevation, 4};
  for (const bool samples : {true, false})
    for (const FitSettings& settings : {FitSettings{}, defaultFitSettings()}) {
      const FittedGrid fit = fitGrid(TestLobe(samples ? 0 : 1, samples), grid, settings);
      REQUIRE(fit.records.size() == 1);
      CHECK((fit.records[0].count == 0 && fit.records[0].integral == 0 && fit.records[0].albedo == 0));
      CHECK(fit.lookup == std::vector<std::uint32_t>(4, 0));
    }
}

TEST_CASE("fitter: errors say why a lobe cannot be fitted") {
  const DirectionGrid grid{GridKind::elevation, 4};
  CHECK_THROWS_WITH(fitGrid(TestLobe(std::nan("")), grid, {}), Catch::Contains("its value is nan"));
  CHECK_THROWS_WITH(fitLobe(TestLobe(1, true, 5e-6f), direction(20), {}), Catch::Contains("too narrow"));
}

TEST_CASE("fitter: directions of a fixed grid for which a lobe is too narrow get records without components") {
  const DirectionGrid grid{GridKind::elevation, 4};
  for (const FitMethod method : {FitMethod::wem, FitMethod::ceres, FitMethod::eq8, FitMethod::automatic}) {
    FitSettings settings;
    settings.method = method;
    const FittedGrid fit = fitGrid(TestLobe(1, true, 5e-6f), grid, settings);
    REQUIRE(fit.records.size() == 4);
    CHECK(fit.components.empty());
    for (const CacheRecord& r : fit.records) CHECK((r.count == 0 && r.cosineMass == 0 && r.albedo > 0));
  }
}

TEST_CASE("fitter: adaptive fits leave directions for which a lobe is too narrow to BSDF sampling") {
  const DirectionGrid grid{GridKind::elevation, 16};
  const FittedGrid fit = fitGrid(TestLobe(1, true, 0.3f, 5e-6f), grid, defaultFitSettings());
  REQUIRE(fit.records.size() > 1);
  for (const CacheRecord& r : fit.records)
    CHECK((r.count > 0) == (grid.direction(static_cast<int>(r.entry)).z() >= 0.5f));
}

TEST_CASE("fitter: look-up rotates and translates mixtures towards the query in the right direction") {
  const LobePtr lobe = conductorLobe(0.05, 0.05);
  const DirectionGrid grid{GridKind::elevation, 24};
  const FittedGrid fit = fitGrid(*lobe, grid, {});
  double moved = 0, unmoved = 0, wrong = 0;
  for (const double elevation : {4.0, 13.0, 29.0, 41.0, 53.0, 66.0, 74.0}) {
    const Vec3 wo = direction(elevation, 117);
    const int entry = grid.nearest(wo);
    const CacheRecord& r = fit.records[static_cast<std::size_t>(entry)];
    std::array<Gaussian, kMaxCacheComponents> buffer;
    const auto own = asGaussians(fit.components).subspan(r.first, r.count);
    const std::span<Gaussian> aligned = alignMixture({grid.kind, toDisc(grid.direction(entry)), {}}, own, wo, buffer);
    REQUIRE(aligned.size() == own.size());
    moved += gradeMixture(*lobe, wo, aligned, 2048).coverage;
    Mixture turned;
    for (const Gaussian& g : own) turned.push_back(rotated(g, wo.head<2>().normalized()));
    unmoved += gradeMixture(*lobe, wo, turned, 2048).coverage;
    for (std::size_t k = 0; k < turned.size(); ++k) {
      turned[k].meanX -= aligned[k].meanX - turned[k].meanX;
      turned[k].meanY -= aligned[k].meanY - turned[k].meanY;
    }
    wrong += gradeMixture(*lobe, wo, turned, 2048).coverage;
  }
  CHECK(moved < 0.7 * unmoved);
  CHECK(unmoved < 0.7 * wrong);
}

TEST_CASE("fitter: look-up in an anisotropic grid translates without rotating") {
  const DirectionGrid grid{GridKind::fibonacci, 200};
  const Gaussian g{1, -0.3f, 0.1f, {0.01f, 0.002f, 0.04f}};
  std::array<Gaussian, 1> out;
  const Vec3 wo = direction(40, 70);
  const int entry = grid.nearest(wo);
  alignMixture({grid.kind, toDisc(grid.direction(entry)), {}}, std::span(&g, 1), wo, out);
  const Vec2 expected = g.mean() - (toDisc(wo) - toDisc(grid.direction(entry)));
  CHECK((out[0].mean() - expected).norm() < 1e-6f);
  CHECK((out[0].cov.xx == g.cov.xx && out[0].cov.xy == g.cov.xy && out[0].cov.yy == g.cov.yy));
}

TEST_CASE("fitter: look-up mirrors the mixtures of symmetric lobes") {
  const Gaussian g{1, -0.3f, 0.1f, {0.01f, 0.002f, 0.04f}};
  std::array<Gaussian, 1> out;
  const Vec3 wo = direction(40, 20);
  const Alignment alignment{GridKind::fibonacci, Vec2(-toDisc(wo).x(), toDisc(wo).y()), {true, false}};
  alignMixture(alignment, std::span(&g, 1), wo, out);  // exactly the mirrored direction, so no translation
  CHECK((out[0].mean() - Vec2(0.3f, 0.1f)).norm() < 1e-6f);
  CHECK((out[0].cov.xx == g.cov.xx && out[0].cov.xy == -g.cov.xy && out[0].cov.yy == g.cov.yy));
}

TEST_CASE("fitter: look-up keeps means inside the disc") {
  const DirectionGrid grid{GridKind::elevation, 2};
  const std::array<Gaussian, 2> mixture{{{0.5f, -0.98f, 0.1f, {0.01f, 0, 0.01f}}, {0.5f, -0.2f, 0, {0.01f, 0, 0.01f}}}};
  std::array<Gaussian, 2> out;
  for (int i = 0; i <= 60; ++i) {
    const Vec3 wo = direction(1.5 * i, 200);
    const Vec2 reference = toDisc(grid.direction(grid.nearest(wo)));
    for (const Gaussian& g : alignMixture({grid.kind, reference, {}}, mixture, wo, out))
      CHECK(g.mean().norm() <= 1.00001f);
  }
}

TEST_CASE("fitter: look-up translates a lobe even if a wide component lies at the edge") {
  const std::array<Gaussian, 2> mixture{{{0.1f, -0.1f, 0.994f, {1, 0, 3}}, {0.9f, -0.2f, 0, {0.01f, 0, 0.01f}}}};
  std::array<Gaussian, 2> out;
  const Vec3 from = direction(20, 5), to = direction(22, -10);
  alignMixture({GridKind::fibonacci, toDisc(from), {}}, mixture, to, out);
  CHECK((out[1].mean() - (mixture[1].mean() + toDisc(from) - toDisc(to))).norm() < 1e-6f);
  CHECK(out[0].mean().norm() <= 1.00001f);
}
