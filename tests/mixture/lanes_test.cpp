// The SIMD kernels of every instruction set, compared with their definitions in double precision.
#include "tests/support/mixture_test_tools.h"

#include <catch2/catch.hpp>

#include "runtime/mixture/lookup.h"
#include "tests/support/packed_mixtures.h"
#include "tests/support/product_oracle.h"

using namespace lobe;

namespace {

/// The two factors of a product; their components have similar widths and are close to each other.
struct Factors {
  Mixture one, two;
  float constant = 0;
};

/// The component counts cover every remainder modulo the vector width.
Factors randomFactors(Rng& rng, int i, float narrow, float wide) {
  const Vec2 centre(0.8f * rng.uniform() - 0.4f, 0.8f * rng.uniform() - 0.4f);
  Factors f{randomMixture(rng, i % 13, narrow, wide, 3 * narrow, 0.7f),
            randomMixture(rng, 1 + i % 8, narrow, wide, 3 * narrow), i % 3 == 0 ? 0.2f : 0.0f};
  if (i % 13 == 0) f.constant = 0.2f;
  for (Mixture* m : {&f.one, &f.two})
    for (Gaussian& g : *m) g.meanX += centre.x(), g.meanY += centre.y();
  return f;
}

Vec2 pointNear(Rng& rng, const Mixture& mixture) {
  const Vec2 u = rng.uniform2();
  return sampleMixture(mixture, rng.uniform(), u);
}

/// The largest relative error of the product's density at points sampled from the product.
double worstDensity(Rng& rng, float narrow, float wide, int runs) {
  double worst = 0;
  for (int i = 0; i < runs; ++i) {
    const Factors f = randomFactors(rng, i, narrow, wide);
    const OwnedProduct product(f.one, f.constant, f.two);
    const double mass = exactMass(f.one, f.constant, f.two);
    REQUIRE(product.mass() > 0);
    for (int k = 0; k < 50; ++k) {
      const Vec2 u = rng.uniform2();
      const Vec2 y = product.sample(rng.uniform(), u);
      const double exact = (f.constant + exactMixture(f.one, y.x(), y.y())) * exactMixture(f.two, y.x(), y.y()) / mass;
      worst = std::max(worst, std::abs(product.pdf(y) / exact - 1));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("lanes: SSE4 kernels exist on every x86-64 machine") {
  CHECK(!kernelTargets().empty());
  const auto names = [&] {
    std::vector<std::string> all;
    for (const std::int64_t target : kernelTargets()) all.push_back(kernelTargetName(target));
    return all;
  }();
#if defined(__x86_64__)
  CHECK(std::ranges::count(names, "SSE4") == 1);
#endif
}

TEST_CASE("lanes: packing is lossless and padding has zero weight") {
  Rng rng(41);
  const Mixture mixture = randomMixture(rng, 6, 0.01f, 0.5f);
  const Packed packed(mixture, 8);
  const Mixture back = unpackGaussians(packed.view());
  for (std::size_t k = 0; k < mixture.size(); ++k)
    CHECK((back[k].weight == mixture[k].weight && back[k].meanX == mixture[k].meanX &&
           back[k].meanY == mixture[k].meanY && back[k].cov.xx == mixture[k].cov.xx &&
           back[k].cov.xy == mixture[k].cov.xy && back[k].cov.yy == mixture[k].cov.yy));
  for (int k = 6; k < 8; ++k) {
    CHECK(packed.view().field(GaussianField::weight)[k] == 0);
    CHECK(packed.view().field(GaussianField::scale)[k] == 0);
  }
}

TEST_CASE("lanes: densities of both factors agree with the definition") {
  onAllTargets([] {
    Rng rng(42);
    for (int i = 0; i < 60; ++i) {
      const Factors f = randomFactors(rng, i, 0.03f, 0.4f);
      const Packed one(f.one), two = packedLight(f.two);
      for (int k = 0; k < 20; ++k) {
        const Vec2 y = pointNear(rng, f.two);
        const Densities both = densities(one.view(), two.view(), y.x(), y.y());
        CHECK(both.reflectance == Approx(exactMixture(f.one, y.x(), y.y())).epsilon(2e-5).margin(1e-30));
        CHECK(both.light == Approx(exactMixture(f.two, y.x(), y.y())).epsilon(2e-5));
        CHECK(lightDensity(two.view(), y.x(), y.y()) == both.light);
      }
      CHECK(lightDensity(two.view(), 1e4f, -1e4f) == 0);
      CHECK(lightDensity(two.view(), 1e20f, 1e20f) == 0);
    }
  });
}

TEST_CASE("lanes: masses of pairs agree with the definition down to the smallest") {
  onAllTargets([] {
    Rng rng(43);
    for (int i = 0; i < 60; ++i) {
      // Both overlapping and distant factors.
      const float narrow = i % 2 == 0 ? 0.05f : 0.02f;
      const Factors f{randomMixture(rng, i % 13, narrow, 0.4f), randomMixture(rng, 1 + i % 8, narrow, 0.4f), 0.1f};
      const Packed one(f.one), two = packedLight(f.two);
      const std::size_t stride = two.view().stride;
      std::vector<float> pairs(stride * (f.one.size() + 1)), columns(stride);
      const float mass = pairMasses(one.view(), f.constant, two.view(), pairs.data(), columns.data());
      CHECK(mass == Approx(exactMass(f.one, f.constant, f.two)).epsilon(5e-6));
      double sum = 0;
      for (std::size_t j = 0; j < stride; ++j) {
        double column = 0;
        for (std::size_t k = 0; k <= f.one.size(); ++k) column += pairs[k * stride + j];
        if (j >= f.two.size()) CHECK(column == 0);
        sum += column;
        CHECK(columns[j] == Approx(sum).epsilon(1e-5));
      }
      CHECK(mass == columns.back());
      for (std::size_t k = 0; k < f.one.size(); ++k)
        for (std::size_t j = 0; j < f.two.size(); ++j) {
          const double exact = exactPair(f.one[k], f.two[j]);
          if (exact > 1e-25)
            CHECK(pairs[k * stride + j] == Approx(exact).epsilon(1e-4));
          else
            CHECK(pairs[k * stride + j] < 2e-25);
        }
    }
  });
}

TEST_CASE("lanes: the density of a product is accurate even for narrow lobes") {
  onAllTargets([] {
    Rng rng(44);
    CHECK(worstDensity(rng, 0.05f, 0.4f, 60) < 5e-6);
    CHECK(worstDensity(rng, 0.001f, 0.001f, 60) < 2e-4);
    CHECK(worstDensity(rng, 0.001f, 0.02f, 60) < 2e-4);
  });
}

TEST_CASE("lanes: the density agrees with the sum over all pairs of Herholz et al. 2016") {
  Rng rng(45);
  for (int i = 0; i < 10; ++i) {
    const Mixture one = randomMixture(rng, 3, 0.1f, 0.4f), two = randomMixture(rng, 5, 0.1f, 0.4f);
    const OwnedProduct product(one, 0, two);
    const Vec2 u = rng.uniform2();
    const Vec2 y = product.sample(rng.uniform(), u);
    CHECK(product.pdf(y) == Approx(exactProductPdf(one, two, y.x(), y.y())).epsilon(1e-4));
  }
}

TEST_CASE("lanes: products of elongated lobes that cross or are parallel") {
  // 300 times as long as wide: the determinant of the sum of two such covariances cancels in single precision.
  onAllTargets([] {
    for (const float angle : {0.0f, 0.3f, 0.78f, 1.5f}) {
      for (const float turn : {0.0f, 1e-3f, 0.1f, 1.3f}) {
        const Mixture one{makeGaussian(1, {0.1f, 0.05f}, 0.3f, 1e-3f, angle)};
        const Mixture two{makeGaussian(1, {0.1004f, 0.0499f}, 0.3f, 1e-3f, angle + turn)};
        const OwnedProduct product(one, 0, two);
        CHECK(product.mass() == Approx(exactMass(one, 0, two)).epsilon(2e-3));
        CHECK(std::isfinite(product.pdf({0.1f, 0.05f})));
      }
    }
  });
}

TEST_CASE("lanes: placing a mixture agrees with alignMixture followed by a rotation") {
  onAllTargets([] {
    Rng rng(46);
    for (int i = 0; i < 200; ++i) {
      const int count = 1 + i % 13;
      // Some means are outside the disc.
      const Mixture mixture = randomMixture(rng, count, 0.005f, 0.5f, 1.2f);
      const Packed packed(mixture, paddedCount(count));
      const Alignment alignment{i % 2 == 0 ? GridKind::elevation : GridKind::fibonacci,
                                i % 2 == 0 ? Vec2(0.6f * rng.uniform(), 0) : Vec2(0.6f * rng.uniform(), 0.3f),
                                {i % 3 == 0, i % 5 == 0}};
      const Vec2 y = 0.7f * Vec2(2 * rng.uniform() - 1, 2 * rng.uniform() - 1);
      const Vec3 wo = fromDisc(y);
      const float angle = 6 * rng.uniform();
      const Vec2 turn(std::cos(angle), std::sin(angle));
      Mixture expected(static_cast<std::size_t>(count));
      for (Gaussian& g : alignMixture(alignment, mixture, wo, expected)) g = rotated(g, turn), g.weight *= 0.3f;

      Placement placement = placementOf(alignment, wo);
      const float c = placement.cosine, s = placement.sine;
      placement.cosine = turn.x() * c - turn.y() * s;
      placement.sine = turn.y() * c + turn.x() * s;
      placement.factor = 0.3f;
      GaussianStore<kMaxReflectanceComponents> store;
      store.add(makeGaussian(1, {0, 0}, 0.1f, 0.1f, 0));
      placeMixture(packed.view(), placement, store.data(), store.kStride, store.count());
      store.grow(count);
      const Packed repacked(expected);
      for (int k = 0; k < count; ++k) {
        const Gaussian g = gaussianAt(store.view(), k + 1), &e = expected[static_cast<std::size_t>(k)];
        CHECK((g.mean() - e.mean()).norm() < 1e-5f);
        CHECK(g.weight == Approx(e.weight));
        const float size = e.cov.xx + e.cov.yy;
        CHECK(std::abs(g.cov.xx - e.cov.xx) + std::abs(g.cov.xy - e.cov.xy) + std::abs(g.cov.yy - e.cov.yy) <
              2e-5f * size);
        for (const GaussianField f : {GaussianField::along, GaussianField::scale})
          CHECK(store.view().field(f)[k + 1] == Approx(repacked.view().field(f)[k]).epsilon(5e-2));
      }
      const Gaussian first = gaussianAt(store.view(), 0);
      CHECK((first.weight == 1 && first.meanX == 0));
      // Fields used for evaluation agree with those used for sampling.
      const float* across = store.view().field(GaussianField::across);
      for (int k = 1; k <= count; ++k) {
        const Gaussian g = gaussianAt(store.view(), k);
        const double d = -kHalfLog2e / across[k], scale = store.view().field(GaussianField::scale)[k];
        CHECK(scale == Approx(g.weight * 0.5 * std::numbers::inv_pi / std::sqrt(d * g.cov.xx)).epsilon(1e-5));
      }
    }
  });
}

TEST_CASE("lanes: samples of the product follow its density with every instruction set") {
  onAllTargets([] {
    Rng rng(47);
    constexpr int kRuns = 8;
    for (int i = 0; i < kRuns; ++i) {
      const Mixture one = randomMixture(rng, 1 + 2 * i, 0.03f, 0.4f, 1.3f, 0.8f),
                    two = randomMixture(rng, 1 + i, 0.03f, 0.5f);
      const OwnedProduct product(one, i % 3 == 0 ? 0.3f : 0.0f, two);
      const auto draw = [&](Rng& r) {
        const float choice = r.uniform();
        return product.sample(choice, r.uniform2());
      };
      CHECK(chi2PValue({{0, 0}, 1.4f}, draw, [&](const Vec2& y) { return product.pdf(y); }) > sidak(3 * kRuns));
    }
  });
}

TEST_CASE("lanes: samples of the illumination mixture follow its density") {
  Rng rng(48);
  const Mixture two = randomMixture(rng, 7, 0.03f, 0.5f);
  const Packed light = packedLight(two);
  const auto draw = [&](Rng& r) {
    const float choice = r.uniform();
    return sampleGaussians(light.view(), choice, r.uniform2());
  };
  CHECK(chi2PValue({{0, 0}, 1.4f}, draw, [&](const Vec2& y) { return lightDensity(light.view(), y.x(), y.y()); }) >
        0.01);
}

TEST_CASE("lanes: products outside the disc and with masses near the minimum") {
  onAllTargets([] {
    const Mixture one{makeGaussian(1, {1.6f, 0}, 0.05f, 0.05f, 0)}, two{makeGaussian(1, {1.65f, 0.1f}, 0.1f, 0.05f, 1)};
    const OwnedProduct outside(one, 0, two);
    REQUIRE(outside.mass() > 0);
    const auto draw = [&](Rng& r) {
      const float choice = r.uniform();
      return outside.sample(choice, r.uniform2());
    };
    CHECK(chi2PValue({{1.6f, 0}, 0.4f}, draw, [&](const Vec2& y) { return outside.pdf(y); }) > 0.003);

    // The mass goes from far above to far below the minimum: the product is empty or its density is correct.
    for (float distance = 0.3f; distance < 1.5f; distance += 0.01f) {
      const Mixture a{makeGaussian(0.5f, {-distance / 2, 0.1f}, 0.05f, 0.04f, 0.2f)},
          b{makeGaussian(1, {distance / 2, -0.1f}, 0.04f, 0.05f, 0.1f)};
      const OwnedProduct product(a, 0, b);
      const double exact = exactMass(a, 0, b);
      CAPTURE(distance, exact);
      if (exact < 0.99e-30) CHECK(product.mass() == 0);
      if (exact < 1.01e-30) continue;
      CHECK(product.mass() == Approx(exact).epsilon(1e-4));
      const Vec2 y = product.sample(0.5f, {0.4f, 0.3f});
      CHECK(product.pdf(y) ==
            Approx(exactMixture(a, y.x(), y.y()) * exactMixture(b, y.x(), y.y()) / exact).epsilon(1e-3));
    }
  });
}
