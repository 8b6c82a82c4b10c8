// The product of two mixtures. Formulas misprinted in Herholz et al. 2016 must fail the checks that ours pass.
#include "tests/support/mixture_test_tools.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/packed_mixtures.h"

using namespace lobe;

namespace {

double factorsAt(const Mixture& one, float constant, const Mixture& two, const Vec2& y) {
  return (static_cast<double>(constant) + mixturePdf(one, y)) * mixturePdf(two, y);
}

auto sampler(const OwnedProduct& product) {
  return [&product](Rng& rng) {
    const float choice = rng.uniform();
    return product.sample(choice, rng.uniform2());
  };
}

double productPValue(const OwnedProduct& product, const Window& window) {
  return chi2PValue(window, sampler(product), [&](const Vec2& y) { return product.pdf(y); });
}

}  // namespace

TEST_CASE("mixture: the product's mass agrees with quadrature") {
  Rng rng(21);
  for (int i = 0; i < 20; ++i) {
    const Mixture one = randomMixture(rng, 1 + i % 5, 0.05f, 0.4f, 0.9f, 0.6f),
                  two = randomMixture(rng, 8, 0.05f, 0.5f);
    const float constant = i % 2 == 0 ? 0.0f : 0.2f * rng.uniform();
    const OwnedProduct product(one, constant, two);
    const double mass = integrate({{0, 0}, 3}, 400, [&](const Vec2& y) { return factorsAt(one, constant, two, y); });
    CHECK(product.mass() == Approx(mass).epsilon(1e-4));
  }
}

TEST_CASE("mixture: the product density integrates to one unlike the printed Eq. 9") {
  Rng rng(22);
  for (int i = 0; i < 10; ++i) {
    const Mixture one = randomMixture(rng, 3, 0.05f, 0.4f), two = randomMixture(rng, 5, 0.05f, 0.4f);
    const OwnedProduct product(one, 0, two);
    CHECK(integrate({{0, 0}, 3}, 400, [&](const Vec2& y) { return product.pdf(y); }) == Approx(1).epsilon(1e-4));
    // The printed form lacks the normalisation by Z.
    const double printed = integrate({{0, 0}, 3}, 400, [&](const Vec2& y) { return factorsAt(one, 0, two, y); });
    CHECK_FALSE(printed == Approx(1).epsilon(1e-2));
  }
}

TEST_CASE("mixture: the only pair with positive mass is chosen") {
  // The index of a pair that Herholz et al. 2016 print is not unique.
  onAllTargets([] {
    constexpr int kOne = 3, kTwo = 5;
    for (int row = 0; row < kOne; ++row) {
      for (int column = 0; column < kTwo; ++column) {
        Mixture one, two;
        for (int i = 0; i < kOne; ++i) one.push_back(makeGaussian(i == row ? 1 : 0, {0, 0}, 0.1f, 0.1f, 0));
        for (int j = 0; j < kTwo; ++j) two.push_back(makeGaussian(j == column ? 1 : 0, {0, 0}, 0.1f, 0.1f, 0));
        const Packed reflectance(one), light = packedLight(two);
        const int stride = light.view().stride;
        std::vector<float> pairs(static_cast<std::size_t>((kOne + 1) * stride)),
            columns(static_cast<std::size_t>(stride));
        CHECK(pairMasses(reflectance.view(), 0, light.view(), pairs.data(), columns.data()) > 0);
        CHECK(std::ranges::count_if(pairs, [](float mass) { return mass > 0; }) == 1);
        for (const float choice : {0.0f, 0.5f, 0x1.fffffep-1f}) {
          const PairIndex chosen = choosePair(pairs.data(), columns.data(), kOne + 1, stride, choice);
          CHECK((chosen.row == row && chosen.column == column));
        }
      }
    }
  });
}

TEST_CASE("mixture: product samples follow the product's density") {
  Rng rng(23);
  constexpr int kRuns = 10;
  for (int i = 0; i < kRuns; ++i) {
    const Mixture one = randomMixture(rng, 1 + i % 4, 0.03f, 0.4f, 0.9f, 0.8f),
                  two = randomMixture(rng, 5, 0.03f, 0.5f);
    const OwnedProduct product(one, i % 3 == 0 ? 0.3f : 0.0f, two);
    CHECK(productPValue(product, {{0, 0}, 1.2f}) > sidak(kRuns));
  }
}

TEST_CASE("mixture: mutants of the product fail the chi² test") {
  Rng rng(24);
  const Mixture one = randomMixture(rng, 3, 0.05f, 0.4f), two = randomMixture(rng, 5, 0.05f, 0.4f);
  const OwnedProduct product(one, 0, two);
  const Window window{{0, 0}, 1.2f};
  CHECK(productPValue(product, window) > 0.01);
  // Without the normalisation by Z.
  CHECK(chi2PValue(window, sampler(product), [&](const Vec2& y) { return factorsAt(one, 0, two, y); }) < 1e-6);
  // Means weighted by the wrong covariances, which is equivalent to swapping the two means.
  const Gaussian narrow = makeGaussian(1, {0.2f, 0}, 0.1f, 0.1f, 0), wide = makeGaussian(1, {0.35f, 0}, 0.3f, 0.2f, 0);
  const Mixture a{narrow}, b{wide};
  const OwnedProduct single(a, 0, b);
  CHECK(productPValue(single, window) > 0.01);
  Gaussian swappedNarrow = narrow, swappedWide = wide;
  std::swap(swappedNarrow.meanX, swappedWide.meanX);
  const Mixture c{swappedNarrow}, d{swappedWide};
  const OwnedProduct swapped(c, 0, d);
  CHECK(chi2PValue(window, sampler(single), [&](const Vec2& y) { return swapped.pdf(y); }) < 1e-6);
}

TEST_CASE("mixture: products of lobes with standard deviation 0.001") {
  Rng rng(25);
  constexpr int kRuns = 6;
  for (int i = 0; i < kRuns; ++i) {
    const Vec2 mean(0.9f * rng.uniform(), 0.5f * rng.uniform());
    const Mixture one{makeGaussian(0.5f, mean, 1e-3f, 1e-3f * (1 + 0.5f * rng.uniform()), rng.uniform())};
    Mixture two = randomMixture(rng, 7, 0.05f, 0.5f);
    two.push_back(makeGaussian(0.2f, mean + Vec2(5e-4f, -8e-4f), 2e-3f, 1e-3f, rng.uniform()));
    const OwnedProduct product(one, 0, two);
    CHECK(productPValue(product, {mean, 4e-3f}) > sidak(kRuns));
  }
}

TEST_CASE("mixture: products of factors with means outside the disc or far from each other") {
  const Mixture one{makeGaussian(1, {1.3f, 0.2f}, 0.2f, 0.05f, 0.4f), makeGaussian(1, {-1.2f, 0}, 0.3f, 0.3f, 0)};
  const Mixture two{makeGaussian(0.7f, {-0.5f, 0.5f}, 0.2f, 0.2f, 0), makeGaussian(0.3f, {0.9f, 0}, 0.1f, 0.3f, 1)};
  CHECK(productPValue(OwnedProduct(one, 0, two), {{0, 0}, 1.6f}) > 0.005);

  // 14 standard deviations apart: the mass is about 1e-24 but the product must still be valid.
  const Mixture left{makeGaussian(1, {-0.5f, 0}, 0.067f, 0.067f, 0)},
      right{makeGaussian(1, {0.5f, 0}, 0.067f, 0.067f, 0)};
  const OwnedProduct distant(left, 0, right);
  REQUIRE(distant.mass() > 0);
  REQUIRE(distant.mass() < 1e-20f);
  CHECK(productPValue(distant, {{0, 0}, 0.25f}) > 0.005);
}

TEST_CASE("mixture: a product that underflows or is empty or not finite has no mass") {
  const Mixture left{makeGaussian(1, {-0.5f, 0}, 1e-3f, 1e-3f, 0)}, right{makeGaussian(1, {0.5f, 0}, 1e-3f, 1e-3f, 0)};
  CHECK(OwnedProduct(left, 0, right).mass() == 0);
  CHECK(OwnedProduct(Mixture{}, 0, right).mass() == 0);
  CHECK(OwnedProduct(left, 1, Mixture{}).mass() == 0);
  CHECK(OwnedProduct(left, std::numeric_limits<float>::infinity(), right).mass() == 0);
  CHECK(OwnedProduct(left, std::numeric_limits<float>::quiet_NaN(), right).mass() == 0);
}

TEST_CASE("mixture: the product with a constant reflectance is the illumination mixture") {
  Rng rng(26);
  const Mixture light = randomMixture(rng, 6, 0.02f, 0.4f);
  const OwnedProduct product({}, 0.25f, light);
  CHECK(product.mass() == Approx(0.25f));
  for (int i = 0; i < 100; ++i) {
    const Vec2 u = rng.uniform2();
    const Vec2 y = product.sample(rng.uniform(), u);
    CHECK(product.pdf(y) == Approx(mixturePdf(light, y)).epsilon(1e-5));
  }
}

TEST_CASE("mixture: the largest random numbers choose a pair with nonzero weight") {
  const Mixture one{makeGaussian(1, {0, 0}, 0.1f, 0.1f, 0), makeGaussian(0, {0, 0}, 0.1f, 0.1f, 0)};
  const Mixture two{makeGaussian(1, {0, 0}, 0.1f, 0.1f, 0), makeGaussian(0, {50, 50}, 0.1f, 0.1f, 0)};
  const OwnedProduct product(one, 0, two);
  CHECK(product.sample(0x1.fffffep-1f, {0x1.fffffep-1f, 0x1.fffffep-1f}).norm() < 2);
}

TEST_CASE("mixture: an empty component of the light is never chosen") {
  // Sums of random weights depend on the order of the additions.
  onAllTargets([] {
    Rng rng(31);
    const Packed nothing({});
    for (int i = 0; i < 2000; ++i) {
      Mixture mixture;
      for (int k = 0; k < 8; ++k)
        mixture.push_back(makeGaussian(k % 4 == 3 ? 0 : std::exp2(-24 * rng.uniform()), {0, 0}, 0.1f, 0.1f, 0));
      const Packed light = packedLight(mixture);
      std::array<float, 8> pairs, columns;
      pairMasses(nothing.view(), 1, light.view(), pairs.data(), columns.data());
      CHECK(std::ranges::is_sorted(columns));
      for (const float choice : {0.0f, rng.uniform(), 0x1.fffffep-1f}) {
        const PairIndex chosen = choosePair(pairs.data(), columns.data(), 1, 8, choice);
        CHECK(chosen.row == 0);
        CHECK(pairs[static_cast<std::size_t>(chosen.column)] > 0);
      }
    }
  });
}
