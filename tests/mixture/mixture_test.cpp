// The disc map, Gaussians and their merging. Formulas misprinted in the literature are tested together with the printed
// form, which must fail the same test.
#include "tests/support/mixture_test_tools.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "runtime/mixture/fast_exp.h"

using namespace lobe;

namespace {

Vec3 randomDirection(Rng& rng) {
  const float z = rng.uniform(), phi = 2 * std::numbers::pi_v<float> * rng.uniform(), s = std::sqrt(1 - z * z);
  return {s * std::cos(phi), s * std::sin(phi), z};
}

// Whether map goes into the disc, is inverted by fromDisc and maps a quarter of the hemisphere to radii below ½.
template <class Map>
bool isEqualAreaMap(const Map& map) {
  Rng rng(1);
  int inner = 0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3 w = randomDirection(rng);
    const Vec2 y = map(w);
    if (!(y.norm() <= 1.000001f) || !((fromDisc(y) - w).norm() < 2e-3f)) return false;
    inner += y.norm() < 0.5f;
  }
  return std::abs(inner / static_cast<double>(kSamples) - 0.25) < 0.006;
}

// Moments of a mixture's density: weight, mean, second moments about the origin.
Eigen::Matrix<double, 6, 1> moments(const Mixture& mixture) {
  Eigen::Matrix<double, 6, 1> m = m.Zero();
  for (const Gaussian& g : mixture) {
    const double x = g.meanX, y = g.meanY;
    const Eigen::Matrix<double, 6, 1> one{1, x, y, g.cov.xx + x * x, g.cov.xy + x * y, g.cov.yy + y * y};
    m += g.weight * one;
  }
  return m;
}

double logDet(const Gaussian& g) {
  return std::log(static_cast<double>(g.cov.determinant()));
}

// The cost of a merge as printed in Herholz et al. 2016, Eq. 10.
float printedCost(const Gaussian& a, const Gaussian& b) {
  return static_cast<float>(0.5 *
                            (a.weight * b.weight * logDet(merged(a, b)) - a.weight * logDet(a) - b.weight * logDet(b)));
}

Gaussian scaled(const Gaussian& g, float s) {
  return {g.weight, s * g.meanX, s * g.meanY, {s * s * g.cov.xx, s * s * g.cov.xy, s * s * g.cov.yy}};
}

template <class Cost>
bool isMergeCost(const Cost& cost) {
  Rng rng(5);
  for (int i = 0; i < 200; ++i) {
    const Mixture m = randomMixture(rng, 2, 0.02f, 0.5f);
    if (std::abs(cost(m[0], m[0])) > 1e-5f) return false;
    if (!(cost(m[0], m[1]) >= 0)) return false;
    if (std::abs(cost(scaled(m[0], 3), scaled(m[1], 3)) - cost(m[0], m[1])) > 1e-4f) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("mixture: the disc map preserves areas and is invertible unlike the printed one") {
  CHECK(isEqualAreaMap(toDisc));
  CHECK_FALSE(isEqualAreaMap([](const Vec3& w) -> Vec2 { return w.head<2>() / std::sqrt(1 - w.z()); }));
  CHECK(toDisc({0, 0, 1}).norm() == 0);
  CHECK(toDisc({1, 0, 0}).norm() == Approx(1));
}

TEST_CASE("mixture: a density over the disc is twice the density over solid angle") {
  const Gaussian g = makeGaussian(1, {0.3f, -0.2f}, 0.12f, 0.06f, 0.5f);
  double sum = 0;
  constexpr int kSteps = 800;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const float z = (static_cast<float>(i) + 0.5f) / kSteps, s = std::sqrt(1 - z * z);
      const float phi = 2 * std::numbers::pi_v<float> * (static_cast<float>(j) + 0.5f) / kSteps;
      sum += normalPdf(g, toDisc({s * std::cos(phi), s * std::sin(phi), z}));
    }
  }
  const double overSolidAngle = sum * 2 * std::numbers::pi / (static_cast<double>(kSteps) * kSteps);
  CHECK(overSolidAngle / 2 == Approx(1).epsilon(1e-3));
  CHECK_FALSE(overSolidAngle == Approx(1).epsilon(1e-3));
}

TEST_CASE("mixture: the fast exponential has float accuracy and underflows to zero") {
  double worst = 0;
  for (int i = 0; i < 66000; ++i) {
    const float x = -0.0013178f * static_cast<float>(i);
    worst = std::max(worst, std::abs(expNegative(x) / std::exp(static_cast<double>(x)) - 1));
  }
  CHECK(worst < 3e-7);
  CHECK(expNegative(0) == 1);
  CHECK(expNegative(-87.5f) == 0);
  CHECK(expNegative(-std::numeric_limits<float>::infinity()) == 0);
}

TEST_CASE("mixture: a Gaussian integrates to one even if elongated and rotated") {
  Rng rng(2);
  for (int i = 0; i < 40; ++i) {
    const float across = 1e-3f * std::pow(300.0f, rng.uniform()), along = across * (1 + 20 * rng.uniform());
    const Gaussian g = makeGaussian(1, {rng.uniform(), rng.uniform()}, along, across, 6 * rng.uniform());
    // Integrate in whitened coordinates, where the window contains a lobe of any shape.
    const float l11 = std::sqrt(g.cov.xx), l21 = g.cov.xy / l11, l22 = std::sqrt(g.cov.yy - l21 * l21);
    const double mass = l11 * l22 * integrate({{0, 0}, 7}, 60, [&](const Vec2& z) {
                          return normalPdf(g, {g.meanX + l11 * z.x(), g.meanY + l21 * z.x() + l22 * z.y()});
                        });
    CHECK(mass == Approx(1).epsilon(2e-3));
  }
  const Gaussian narrow = makeGaussian(1, {0, 0}, 1e-3f, 1e-3f, 0);
  CHECK(normalPdf(narrow, {1, 1}) == 0);
}

TEST_CASE("mixture: samples follow the density but not that with swapped weights") {
  Rng rng(3);
  for (int i = 0; i < 6; ++i) {
    const Mixture m = randomMixture(rng, 4, 0.02f, 0.3f);
    const auto sample = [&](Rng& r) {
      const float choice = r.uniform();
      return sampleMixture(m, choice, r.uniform2());
    };
    const Window window{{0, 0}, 1.2f};
    CHECK(chi2PValue(window, sample, [&](const Vec2& y) { return mixturePdf(m, y); }) > sidak(6));
    Mixture mutant = m;
    std::swap(mutant[0].weight, mutant[1].weight);
    CHECK(chi2PValue(window, sample, [&](const Vec2& y) { return mixturePdf(mutant, y); }) < 1e-6);
  }
}

TEST_CASE("mixture: components of weight zero are never sampled") {
  const Mixture m{makeGaussian(0, {9, 9}, 0.01f, 0.01f, 0), makeGaussian(0.3f, {0.5f, 0}, 0.01f, 0.01f, 0),
                  makeGaussian(0, {9, 9}, 0.01f, 0.01f, 0)};
  for (const float choice : {0.0f, 0.5f, 0x1.fffffep-1f})
    CHECK((sampleMixture(m, choice, {0.3f, 0.3f}) - Vec2(0.5f, 0)).norm() < 0.1f);
  CHECK(sampleNormal(m[1], {0x1.fffffep-1f, 0}).allFinite());
}

TEST_CASE("mixture: rotating a component rotates its density") {
  Rng rng(4);
  for (int i = 0; i < 50; ++i) {
    const Gaussian g = randomMixture(rng, 1, 0.05f, 0.4f)[0];
    const float a = 6.28f * rng.uniform();
    const Eigen::Rotation2Df turn(a);
    const Vec2 y(rng.uniform() - 0.5f, rng.uniform() - 0.5f);
    CHECK(normalPdf(rotated(g, {std::cos(a), std::sin(a)}), turn * y) ==
          Approx(normalPdf(g, y)).epsilon(2e-3).margin(1e-6));
  }
}

TEST_CASE("mixture: merging preserves weight and mean and second moments") {
  Rng rng(6);
  for (int i = 0; i < 100; ++i) {
    const Mixture pair = randomMixture(rng, 2, 0.01f, 0.5f, 0.9f, 0.7f);
    CHECK((moments({merged(pair[0], pair[1])}) - moments(pair)).cwiseAbs().maxCoeff() < 1e-6);
  }
}

TEST_CASE("mixture: the merge cost is zero for equal components and scale-invariant unlike the printed one") {
  CHECK(isMergeCost(mergeCost));
  CHECK_FALSE(isMergeCost(printedCost));
  // Two isotropic components with weight ½ at distance d: ½ log(1 + d²/(4σ²)).
  const Gaussian a = makeGaussian(0.5f, {0.1f, 0.2f}, 0.1f, 0.1f, 0),
                 b = makeGaussian(0.5f, {0.4f, -0.2f}, 0.1f, 0.1f, 0);
  CHECK(mergeCost(a, b) == Approx(0.5 * std::log(1 + 0.25 / 0.04)).epsilon(1e-5));
}

TEST_CASE("mixture: reduction merges the cheapest pairs up to the threshold") {
  Rng rng(7);
  const Mixture three = randomMixture(rng, 3, 0.03f, 0.1f);
  Mixture doubled;
  for (const Gaussian& g : three) doubled.insert(doubled.end(), 2, {g.weight / 2, g.meanX, g.meanY, g.cov});
  const Mixture original = doubled;
  CHECK(reduce(doubled, 1e-4f) < 1e-4f);
  REQUIRE(doubled.size() == 3);
  CHECK((moments(doubled) - moments(original)).cwiseAbs().maxCoeff() < 1e-6);

  Mixture untouched = three;
  CHECK(reduce(untouched, 0) == 0);
  CHECK(untouched.size() == 3);

  Mixture many = randomMixture(rng, 8, 0.05f, 0.4f);
  const Mixture before = many;
  const float spent = reduce(many, 0.2f);
  CHECK(spent <= 0.2f);
  CHECK(many.size() < before.size());
  CHECK((moments(many) - moments(before)).cwiseAbs().maxCoeff() < 1e-5);
  CHECK(reduce(many, 1e9f) > 0.0f);
  CHECK(many.size() == 1);
}
