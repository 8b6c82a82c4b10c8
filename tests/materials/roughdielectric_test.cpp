// The rough dielectric from both sides: χ² tests, energy, reciprocity, limits.

#include <catch2/catch.hpp>

#include "materials/lobes/fresnel.h"
#include "runtime/core/sampling.h"
#include "tests/support/chi2.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

BsdfPtr roughGlass(const std::string& distribution, double alphaU, double alphaV, double ior,
                   const Rgb& reflectance = grey(1.0f), const Rgb& transmittance = grey(1.0f)) {
  return bsdfOf("roughdielectric", {{"distribution", distribution},
                                    {"alpha_u", alphaU},
                                    {"alpha_v", alphaV},
                                    {"int_ior", ior},
                                    {"ext_ior", 1.0},
                                    {"specular_reflectance", reflectance},
                                    {"specular_transmittance", transmittance}});
}

Chi2Result chi2Of(const Bsdf& drawn, const Bsdf& claimed, const Vec3& wo, std::uint64_t seed) {
  Rng rng(seed);
  const auto sampler = [&]() -> std::optional<Vec3> {
    const float choice = rng.uniform();
    const std::optional<BsdfSample> s = drawn.sample(wo, kUv, choice, rng.uniform2());
    return s ? std::optional<Vec3>(s->wi) : std::nullopt;
  };
  return chi2Sphere(sampler, [&](const Vec3& wi) { return claimed.pdf(wo, wi, kUv); });
}

/// Fractions of energy that are reflected and refracted, and their sum.
struct Energy {
  Mean reflected, refracted, total;
};

Energy energyOf(const Bsdf& bsdf, const Vec3& wo, int samples) {
  Energy energy;
  Rng rng(31);
  for (int i = 0; i < samples; ++i) {
    const float choice = rng.uniform();
    const auto s = bsdf.sample(wo, kUv, choice, rng.uniform2());
    const double value = s ? luminance(s->f) * s->eta * s->eta * std::abs(s->wi.z()) / s->pdf : 0.0;
    const bool same = s && s->wi.z() * wo.z() > 0.0f;
    energy.reflected.add(same ? value : 0.0);
    energy.refracted.add(same ? 0.0 : value);
    energy.total.add(value);
  }
  return energy;
}

}  // namespace

TEST_CASE("materials: samples of a rough dielectric match its density over the sphere from both sides") {
  struct Case {
    const char* distribution;
    double u, v, ior;
  };
  constexpr Case kCases[] = {{"ggx", 0.001, 0.001, 1.5},
                             {"beckmann", 0.02, 0.02, 1.3},
                             {"ggx", 0.1, 0.4, 1.5},
                             {"beckmann", 0.3, 0.1, 1.8},
                             {"ggx", 0.8, 0.8, 0.7}};
  std::uint64_t seed = 500;
  for (const Case& c : kCases) {
    const BsdfPtr glass = roughGlass(c.distribution, c.u, c.v, c.ior, grey(0.5f), Rgb(0.2f, 0.9f, 1.0f));
    for (const double elevation : {0.0, 40.0, 80.0, 100.0, 135.0, 145.0, 179.0}) {
      const Chi2Result r = chi2Of(*glass, *glass, directionAt(elevation, 200.0), ++seed);
      INFO(c.distribution << " " << c.u << "×" << c.v << " of " << c.ior << " at " << elevation << ": " << r.message);
      CHECK(r.passed(35));
    }
  }
}

TEST_CASE("materials: the chi-square test rejects a rough dielectric of slightly different index or tint") {
  const BsdfPtr right = roughGlass("ggx", 0.2, 0.2, 1.5);
  for (const double elevation : {40.0, 150.0}) {
    const Vec3 wo = directionAt(elevation, 10.0);
    CHECK_FALSE(chi2Of(*right, *roughGlass("ggx", 0.2, 0.2, 1.53), wo, 1).passed(1000));
    CHECK_FALSE(chi2Of(*right, *roughGlass("ggx", 0.2, 0.2, 1.5, grey(0.5f)), wo, 1).passed(1000));
  }
}

TEST_CASE("materials: a lossless rough dielectric loses only multiple scattering and its mixture matches its energy") {
  for (const std::string distribution : {"ggx", "beckmann"})
    for (const double alpha : {0.001, 0.1, 0.5})
      for (const double elevation : {0.0, 50.0, 80.0, 95.0, 130.0, 140.0, 180.0}) {
        const BsdfPtr glass = roughGlass(distribution, alpha, alpha, 1.5);
        const Vec3 wo = directionAt(elevation, 30.0);
        const Energy energy = energyOf(*glass, wo, 6000);
        INFO(distribution << " " << alpha << " at " << elevation);
        CHECK(energy.total.value() <= 1.0 + 1e-5);
        CHECK(energy.total.value() > (alpha < 0.01 ? 0.995 : alpha < 0.2 ? 0.84 : 0.58));
        const LobeMixture mixture = glass->mixture(wo, kUv);
        // The mixture uses a table, which smooths the kink of total internal reflection.
        CHECK(mixture.undescribedFraction ==
              Approx(energy.refracted.value()).margin(4.0 * energy.refracted.error() + 0.06));
        Mean modelled;
        Rng rng(32);
        const Lobe& lobe = *glass->lobes()[static_cast<std::size_t>(mixture.glossy[0].lobe)];
        const Vec3 up(wo.x(), wo.y(), std::abs(wo.z()));
        for (int i = 0; i < 6000; ++i) {
          const auto s = lobe.sample(up, rng.uniform2());
          modelled.add(s ? lobe.eval(up, s->wi) * s->wi.z() / s->pdf : 0.0);
        }
        CHECK(modelled.value() ==
              Approx(energy.reflected.value()).margin(4.0 * (energy.reflected.error() + modelled.error()) + 1e-4));
      }
}

TEST_CASE("materials: a rough dielectric is reciprocal once radiance is divided by the squared index") {
  Rng rng(33);
  const double ior = 1.5;
  for (const std::string distribution : {"ggx", "beckmann"})
    for (const double alpha : {0.003, 0.3}) {
      const BsdfPtr glass = roughGlass(distribution, alpha, 2.0 * alpha, ior);
      const auto index2 = [&](const Vec3& w) { return w.z() > 0.0f ? 1.0 : ior * ior; };
      double worst = 0.0;
      int refracted = 0;
      for (int i = 0; i < 4000; ++i) {
        const Vec3 wo = squareToSphere(rng.uniform2());
        const float choice = rng.uniform();
        const auto s = glass->sample(wo, kUv, choice, rng.uniform2());
        if (!s) continue;
        refracted += s->eta != 1.0f;
        const double a = s->f.x() / index2(wo), b = glass->eval(s->wi, wo, kUv).x() / index2(s->wi);
        worst = std::max(worst, std::abs(a - b) / (a + b));
        CHECK(s->eta * s->eta == Approx(index2(s->wi) / index2(wo)));
      }
      INFO(distribution << " " << alpha);
      CHECK(refracted > 1000);
      CHECK(worst < 2e-3);  // due to the rounding of wi near the kink at the critical angle
    }
}

TEST_CASE("materials: a rough dielectric of negligible roughness matches the smooth one") {
  const Rgb red(0.9f, 0.4f, 0.2f), blue(0.1f, 0.5f, 0.8f);
  const BsdfPtr rough = roughGlass("ggx", 0.0005, 0.0005, 1.5, red, blue);
  const BsdfPtr smooth =
      bsdfOf("dielectric",
             {{"int_ior", 1.5}, {"ext_ior", 1.0}, {"specular_reflectance", red}, {"specular_transmittance", blue}});
  for (const double elevation : {10.0, 60.0, 120.0, 150.0, 175.0}) {
    const Vec3 wo = directionAt(elevation, 70.0);
    for (const float choice : {0.0f, 0.9999f}) {
      const auto a = rough->sample(wo, kUv, choice, Vec2(0.4f, 0.3f));
      const auto b = smooth->sampleDelta(wo, kUv, choice);
      REQUIRE(a);
      REQUIRE(b);
      INFO(elevation << " " << choice);
      CHECK((a->wi - b->wi).norm() < 5e-3f);
      CHECK(a->eta == Approx(b->eta));
      const Rgb weight = a->f * std::abs(a->wi.z()) / a->pdf;
      CHECK(((weight - b->weight).abs() / b->weight).maxCoeff() < 5e-3f);
    }
    CHECK((rough->albedo(wo, kUv) - smooth->albedo(wo, kUv)).abs().maxCoeff() < 5e-3f);
  }
}

TEST_CASE("materials: rough dielectrics are defined for black tints and directions in the surface plane") {
  CHECK_THROWS_AS(roughGlass("ggx", 0.1, 0.1, 1.0), ParameterError);
  const BsdfPtr black = roughGlass("ggx", 0.1, 0.1, 1.5, grey(0.0f), grey(0.0f));
  const BsdfPtr glass = roughGlass("ggx", 0.1, 0.1, 1.5);
  const Vec3 above = directionAt(30.0), below = directionAt(160.0);
  CHECK_FALSE(black->sample(above, kUv, 0.5f, Vec2(0.5f, 0.5f)));
  CHECK(black->pdf(above, below, kUv) == 0.0f);
  CHECK(black->mixture(above, kUv).undescribedFraction == 0.0f);
  for (const Vec3& w : {above, below}) {
    CHECK(glass->eval(w, Vec3::UnitX(), kUv).maxCoeff() == 0.0f);
    CHECK(glass->eval(Vec3::UnitX(), w, kUv).maxCoeff() == 0.0f);
    CHECK(glass->pdf(Vec3::UnitX(), w, kUv) == 0.0f);
  }
  CHECK_FALSE(glass->sample(Vec3::UnitX(), kUv, 0.5f, Vec2(0.5f, 0.5f)));
  CHECK(glass->mixture(Vec3::UnitX(), kUv).glossyCount == 0);
  // No facet refracts these directions into each other: they are on the same side in azimuth.
  CHECK(glass->eval(directionAt(60.0), directionAt(91.0, 0.0), kUv).maxCoeff() == 0.0f);
  // Beyond the critical angle all light is reflected. Each side has its own lobe.
  CHECK(roughGlass("ggx", 0.001, 0.001, 1.5)->mixture(directionAt(125.0), kUv).undescribedFraction < 0.01f);
  CHECK(glass->mixture(below, kUv).glossy[0].lobe == 1);
  CHECK(glass->lobes()[0]->key() != glass->lobes()[1]->key());
}

}  // namespace lobe
