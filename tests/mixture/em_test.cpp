// Weighted EM and on-line (stepwise) EM.
#include "tests/support/mixture_test_tools.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "runtime/mixture/em.h"
#include "runtime/mixture/product.h"

using namespace lobe;

namespace {

using Points = std::vector<WeightedPoint>;

Points drawPoints(const Mixture& m, int count, Rng& rng) {
  Points points;
  while (static_cast<int>(points.size()) < count) {
    const float choice = rng.uniform();
    points.push_back({sampleMixture(m, choice, rng.uniform2()), 1});
  }
  return points;
}

double smallestEigenvalue(const Covariance& c) {
  return 0.5 * (c.xx + c.yy) - std::hypot(0.5 * (c.xx - c.yy), static_cast<double>(c.xy));
}

bool same(const Mixture& a, const Mixture& b, float tolerance) {
  if (a.size() != b.size()) return false;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const auto near = [&](float x, float y) { return std::abs(x - y) <= tolerance; };
    if (!near(a[k].weight, b[k].weight) || !near(a[k].meanX, b[k].meanX) || !near(a[k].meanY, b[k].meanY) ||
        !near(a[k].cov.xx, b[k].cov.xx) || !near(a[k].cov.xy, b[k].cov.xy) || !near(a[k].cov.yy, b[k].cov.yy))
      return false;
  }
  return true;
}

const Mixture kTruth{makeGaussian(0.5f, {0.3f, 0.2f}, 0.1f, 0.05f, 0.6f),
                     makeGaussian(0.3f, {-0.4f, 0}, 0.08f, 0.12f, 0),
                     makeGaussian(0.2f, {0.1f, -0.5f}, 0.05f, 0.04f, 1)};
const Mixture kStart{makeGaussian(0.4f, {0.5f, 0.5f}, 0.2f, 0.2f, 0), makeGaussian(0.3f, {-0.6f, 0.2f}, 0.2f, 0.2f, 0),
                     makeGaussian(0.3f, {0, -0.7f}, 0.2f, 0.2f, 0)};

// Samples from three lobes and a constant background, over the hemisphere.
struct Target {
  Mixture lobes = kTruth;
  float background;
  WeightedPoint draw(Rng& rng) const {
    for (;;) {
      if (rng.uniform() < background) {
        const float r = std::sqrt(1 - std::sqrt(rng.uniform())), phi = 2 * std::numbers::pi_v<float> * rng.uniform();
        return {{r * std::cos(phi), r * std::sin(phi)}, 1};
      }
      const float choice = rng.uniform();
      const Vec2 y = sampleMixture(lobes, choice, rng.uniform2());
      if (insideDisc(y)) return {y, 1};
    }
  }
  Points draw(Rng& rng, int count) const {
    Points points;
    for (int i = 0; i < count; ++i) points.push_back(draw(rng));
    return points;
  }
};

double likelihood(const Points& points, const StepwiseEm& em) {
  return meanLogLikelihood(points, em.gaussians(), em.background());
}

// Checks everything that the renderer relies on.
bool isValid(const StepwiseEm& em) {
  double sum = 0;
  for (const Gaussian& g : em.gaussians()) {
    if (!std::isfinite(g.weight + g.meanX + g.meanY + g.cov.xx + g.cov.xy + g.cov.yy)) return false;
    if (!(g.weight >= 0) || !(smallestEigenvalue(g.cov) > 0.9 * std::sqrt(StepwiseEm::kMinDeterminant))) return false;
    sum += g.weight;
  }
  const float u = em.background();
  return std::abs(sum - 1) < 1e-5 && u >= 0 && u <= 1 && std::isfinite(em.pdf({0.1f, 0.2f}));
}

}  // namespace

TEST_CASE("mixture: weighted EM recovers a known mixture") {
  Rng rng(41);
  const Points points = drawPoints(kTruth, 20000, rng);
  Mixture fitted = kStart;
  CHECK(weightedEm(points, fitted, {200, 1e-7, 1e-9}) > 1);
  CHECK(same(fitted, kTruth, 0.02f));
  CHECK(meanLogLikelihood(points, fitted) >= meanLogLikelihood(points, kTruth) - 1e-4);
}

TEST_CASE("mixture: weighted EM accounts for the density of its points") {
  // Points of a wide Gaussian, weighted by target / source, fit the target.
  const Mixture wide{makeGaussian(1, {0, 0}, 0.6f, 0.6f, 0)};
  Rng rng(42);
  Points points = drawPoints(wide, 60000, rng);
  for (WeightedPoint& p : points) p.weight = mixturePdf(kTruth, p.y) / mixturePdf(wide, p.y);
  Mixture fitted = kStart;
  weightedEm(points, fitted, {200, 1e-7, 1e-9});
  CHECK(same(fitted, kTruth, 0.03f));
}

TEST_CASE("mixture: weighted EM depends only on ratios of weights and treats a weight of two as two points") {
  Rng rng(43);
  Points points = drawPoints(kTruth, 500, rng);
  Points doubled = points, scaled = points;
  for (std::size_t i = 0; i < 100; ++i) {
    points[i].weight = 2;
    doubled.push_back(doubled[i]);
    scaled[i].weight = 2;
  }
  for (WeightedPoint& p : scaled) p.weight *= 1e6f;
  Mixture once = kStart, twice = kStart, large = kStart;
  weightedEm(points, once);
  weightedEm(doubled, twice);
  weightedEm(scaled, large);
  CHECK(same(once, twice, 1e-5f));
  CHECK(same(once, large, 1e-5f));
}

TEST_CASE("mixture: weighted EM keeps the minimum variance and handles empty and degenerate input") {
  Mixture fitted = kStart;
  CHECK(weightedEm({}, fitted) == 0);
  CHECK(weightedEm(Points{{{0, 0}, 0}}, fitted) == 0);
  CHECK(same(fitted, kStart, 0));
  Mixture none;
  CHECK(weightedEm(Points{{{0, 0}, 1}}, none) == 0);

  const Points equal(10, {{0.2f, 0.3f}, 1});
  weightedEm(equal, fitted, {100, 1e-4, 1e-6});
  float sum = 0;
  for (const Gaussian& g : fitted) {
    sum += g.weight;
    if (g.weight > 0) CHECK(smallestEigenvalue(g.cov) == Approx(1e-6).epsilon(0.01));
  }
  CHECK(sum == Approx(1));

  // A point a thousand standard deviations from every component still attracts one of them.
  Mixture narrow{makeGaussian(1, {0, 0}, 1e-3f, 1e-3f, 0), makeGaussian(1, {0.1f, 0}, 1e-3f, 1e-3f, 0)};
  weightedEm(Points{{{0, 0}, 1}, {{0.9f, 0.9f}, 1}}, narrow);
  CHECK(narrow[1].meanX == Approx(0.9f));
  CHECK(smallestEigenvalue(narrow[1].cov) > 0);
}

TEST_CASE("mixture: the likelihood never decreases during EM") {
  Rng rng(44);
  const Points points = drawPoints(kTruth, 1000, rng);
  Mixture fitted = kStart;
  double last = meanLogLikelihood(points, fitted);
  for (int sweep = 0; sweep < 20; ++sweep) {
    weightedEm(points, fitted, {1, 0, 1e-9});
    const double now = meanLogLikelihood(points, fitted);
    CHECK(now >= last - 1e-6);
    last = now;
  }
  CHECK(meanLogLikelihood(Points{{{50, 50}, 1}}, fitted) == -std::numeric_limits<double>::infinity());
}

TEST_CASE("mixture: on-line training approaches the true distribution with more passes") {
  for (const float background : {0.05f, 0.25f, 0.5f}) {
    const Target target{.background = background};
    double after[3] = {}, truth = 0, learnt = 0;
    constexpr int kRepeats = 10;
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      Rng rng(45, static_cast<std::uint64_t>(repeat));
      const Points unseen = target.draw(rng, 4000);
      truth += meanLogLikelihood(unseen, target.lobes, background) / kRepeats;
      StepwiseEm em(8);
      em.fit(target.draw(rng, 250));
      CHECK(em.samplesSeen() == 250);
      after[0] += likelihood(unseen, em) / kRepeats;
      for (int pass = 1; pass <= 29; ++pass) {
        em.update(target.draw(rng, 250));
        if (pass == 5) after[1] += likelihood(unseen, em) / kRepeats;
      }
      CHECK(em.samplesSeen() == 7500);
      after[2] += likelihood(unseen, em) / kRepeats;
      learnt += em.background() / kRepeats;
    }
    INFO("background " << background << ", learnt " << learnt << ", log-likelihood below the truth by "
                       << truth - after[0] << ", " << truth - after[1] << ", " << truth - after[2]);
    CHECK(after[1] > after[0]);
    CHECK(after[2] > after[1]);
    CHECK(truth - after[0] < 0.15);
    CHECK(truth - after[2] < 0.03);
    CHECK(std::abs(learnt - background) < 0.08);
  }
}

TEST_CASE("mixture: a refit to the points of all passes improves on on-line training") {
  const Target target{.background = 0.25f};
  double before = 0, after = 0, updated = 0, truth = 0;
  constexpr int kRepeats = 20;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    Rng rng(46, static_cast<std::uint64_t>(repeat));
    const Points unseen = target.draw(rng, 4000);
    truth += meanLogLikelihood(unseen, target.lobes, target.background) / kRepeats;
    Points all = target.draw(rng, 250);
    StepwiseEm em(8);
    em.fit(all);
    for (int pass = 0; pass < 4; ++pass) {
      const Points more = target.draw(rng, 250);
      em.update(more);
      all.insert(all.end(), more.begin(), more.end());
    }
    before += likelihood(unseen, em) / kRepeats;
    em.refit(all);
    CHECK(isValid(em));
    CHECK(em.samplesSeen() == 1250);
    after += likelihood(unseen, em) / kRepeats;
    em.update(target.draw(rng, 250));
    updated += likelihood(unseen, em) / kRepeats;
  }
  INFO("log-likelihood below the truth by " << truth - before << ", after the refit " << truth - after
                                            << ", after another update " << truth - updated);
  CHECK(truth - after < 0.8 * (truth - before));
  CHECK(truth - updated < truth - before);  // the update continues from the statistics of the refit
}

TEST_CASE("mixture: a refit depends only on ratios of weights and ignores invalid points") {
  const Target target{.background = 0.3f};
  Rng rng(47);
  Points points = target.draw(rng, 400);
  StepwiseEm once(8);
  once.fit(points);
  StepwiseEm scaled = once, none = once;
  once.refit(points);
  for (WeightedPoint& p : points) p.weight *= 1e-6f;
  points.push_back({{2, 0}, 1});
  points.push_back({{0, 0}, std::numeric_limits<float>::quiet_NaN()});
  scaled.refit(points);
  CHECK(same(once.gaussians(), scaled.gaussians(), 1e-4f));
  CHECK(once.background() == Approx(scaled.background()));
  const Mixture kept = none.gaussians();
  none.refit(Points{{{2, 0}, 1}, {{0, 0}, 0}});
  none.refit({});
  CHECK(same(none.gaussians(), kept, 0));
}

TEST_CASE("mixture: the priors dominate while there are few points") {
  // A single point: u ≥ 8 / (1 + 8 + K v) wherever it is.
  StepwiseEm em(8);
  em.fit(Points{{{0.3f, 0.4f}, 1}});
  const float least = 8.0f / (1 + 8 + 8 * StepwiseEm::kPriorV);
  CHECK(em.background() >= least);
  CHECK(em.background() <= least + 1.0f / (1 + 8 + 8 * StepwiseEm::kPriorV));

  // One component and no background except the prior's: every point belongs to the Gaussian, so the result is known:
  // Σ = b I / (a + n) and u = 8 / (n + 8 + v).
  const int n = 400;  // few enough for Σ to stay above its lower bound
  StepwiseEm one(1);
  one.fit(Points(n, {{0.3f, 0.4f}, 1}));
  CHECK(one.background() == Approx(8.0 / (n + 8 + StepwiseEm::kPriorV)).epsilon(0.05));
  CHECK(one.gaussians()[0].weight == 1);
  StepwiseEm narrow(1);
  narrow.fit(Points(n, {{0.3f, 0.4f}, 1}));
  CHECK(narrow.gaussians()[0].cov.xx == Approx(StepwiseEm::kPriorB / (StepwiseEm::kPriorA + n)).epsilon(0.02));
}

TEST_CASE("mixture: on-line training hardly depends on the order of its points") {
  const Target target{.background = 0.2f};
  Rng rng(46);
  const Points unseen = target.draw(rng, 4000);
  StepwiseEm shuffled(8), sorted(8);
  for (int pass = 0; pass < 6; ++pass) {
    Points points = target.draw(rng, 250);
    pass == 0 ? shuffled.fit(points) : shuffled.update(points);
    std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.y.x() < b.y.x(); });
    pass == 0 ? sorted.fit(points) : sorted.update(points);
  }
  CHECK(std::abs(likelihood(unseen, sorted) - likelihood(unseen, shuffled)) < 0.03);
}

TEST_CASE("mixture: on-line training depends only on ratios of weights and is deterministic") {
  const Target target{.background = 0.3f};
  Rng rng(47);
  Points points = target.draw(rng, 300), scaled = points;
  for (WeightedPoint& p : scaled) p.weight = 0x1p-20f;
  StepwiseEm one(8), two(8);
  one.fit(points);
  two.fit(scaled);
  CHECK(same(one.gaussians(), two.gaussians(), 1e-5f));
  CHECK(one.background() == Approx(two.background()));

  StepwiseEm copy = one;
  copy.update(points);
  one.update(points);
  CHECK(same(one.gaussians(), copy.gaussians(), 0));
}

TEST_CASE("mixture: invalid points are ignored") {
  const Target target{.background = 0.3f};
  Rng rng(48);
  const Points points = target.draw(rng, 100);
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  const Points junk{{{0, 0}, 0},   {{0, 0}, -1},  {{0, 0}, nan}, {{0, 0}, infinity},
                    {{2, 0}, 100}, {{1, 0}, 100}, {{nan, 0}, 1}, {{0, infinity}, 1}};
  StepwiseEm untouched(8);
  untouched.fit(junk);
  untouched.update(junk);
  untouched.update({});
  CHECK(untouched.samplesSeen() == 0);
  CHECK(isValid(untouched));
  CHECK(same(untouched.gaussians(), StepwiseEm(8).gaussians(), 0));

  StepwiseEm em(8);
  Points mixed = points;
  mixed.insert(mixed.end(), junk.begin(), junk.end());
  em.fit(mixed);
  CHECK(em.samplesSeen() == 100);
  CHECK(isValid(em));
}

TEST_CASE("mixture: training stays valid on degenerate points") {
  Rng rng(49);
  const Target target{.background = 0.3f};
  std::vector<std::pair<const char*, Points>> sets{{"one point", {{{0.3f, 0.4f}, 1}}},
                                                   {"all in one place", Points(300, {{0.3f, 0.4f}, 1})},
                                                   {"at the pole", Points(300, {{0, 0}, 1})},
                                                   {"at the edge", Points(300, {{0.9999999f, 0}, 1})}};
  Points ring, wild, line, few;
  for (int i = 0; i < 300; ++i) {
    const float phi = 6.28f * rng.uniform();
    ring.push_back({{0.99999f * std::cos(phi), 0.99999f * std::sin(phi)}, 1});
    wild.push_back(target.draw(rng));
    wild.back().weight = std::pow(10.0f, 12 * rng.uniform() - 6);
    line.push_back({{rng.uniform() - 0.5f, 0.25f}, 1});
    if (i < 3) few.push_back(target.draw(rng));
  }
  sets.insert(sets.end(), {{"ring", ring}, {"wild weights", wild}, {"line", line}, {"fewer than components", few}});
  sets.push_back({"tiny weights", Points(300, {{0.1f, 0.1f}, 1e-38f})});
  sets.push_back({"huge weights", Points(300, {{0.1f, 0.1f}, 3e38f})});
  for (const auto& [name, points] : sets) {
    for (const int components : {1, 8, kMaxIlluminationComponents}) {
      INFO(name << ", " << components << " components");
      StepwiseEm em(components);
      em.fit(points);
      CHECK(isValid(em));
      for (int pass = 0; pass < 30; ++pass) em.update(points);
      CHECK(isValid(em));
      // Continue with very different points, and start with an update of an untrained mixture.
      em.update(wild);
      CHECK(isValid(em));
      StepwiseEm unfitted(components);
      unfitted.update(points);
      CHECK(isValid(unfitted));
    }
  }
}

TEST_CASE("mixture: a light too small to resolve is learnt with the minimum variance") {
  Rng rng(50);
  const Target rest{.background = 1.0f};
  const Vec2 light(0.3f, 0.4f);
  StepwiseEm em(8);
  for (int pass = 0; pass < 30; ++pass) {
    Points points = rest.draw(rng, 125);
    points.insert(points.end(), 125, {light, 1});
    pass == 0 ? em.fit(points) : em.update(points);
    // The light has half of the total weight; it must be found within a hundredth of the disc's radius.
    double inside = 0;
    for (const Gaussian& g : em.gaussians())
      if ((g.mean() - light).norm() < 0.01f && g.cov.xx + g.cov.yy < 2e-4f) inside += (1 - em.background()) * g.weight;
    CHECK(inside == Approx(0.5).margin(0.06));
  }
  CHECK(isValid(em));
}

TEST_CASE("mixture: an invalid number of components is an error") {
  CHECK_THROWS(StepwiseEm(0));
  CHECK_THROWS(StepwiseEm(kMaxIlluminationComponents + 1));
}
