// The parts of the principled model, each compared with a closed form or another model.

#include <catch2/catch.hpp>

#include "runtime/core/sampling.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

using Values = std::initializer_list<std::pair<std::string, ParameterValue>>;

BsdfPtr principled(Values values) {
  return bsdfOf("principled", values);
}

/// Without the specular interface: only the diffuse part is left.
BsdfPtr withoutInterface(double roughness, double flatness, double reflectance, double sheen) {
  return principled({{"specular", 0.0},
                     {"roughness", roughness},
                     {"flatness", flatness},
                     {"base_color", reflectance},
                     {"sheen", sheen}});
}

Vec3 randomAbove(Rng& rng) {
  return squareToCosineHemisphere(rng.uniform2());
}

}  // namespace

TEST_CASE("materials: a principled metal is a GGX conductor with Schlick's reflectance") {
  const Rgb base(0.9f, 0.6f, 0.3f);
  const BsdfPtr metal = principled({{"metallic", 1.0}, {"roughness", 0.6}, {"base_color", base}});
  const BsdfPtr white =
      bsdfOf("roughconductor",
             {{"alpha", 0.6 * 0.6}, {"distribution", std::string("ggx")}, {"material", std::string("none")}});
  Rng rng(51);
  for (int i = 0; i < 200; ++i) {
    const Vec3 wo = randomAbove(rng);
    const Vec3 wi = randomAbove(rng);
    const float weight = std::pow(1.0f - wo.dot((wo + wi).normalized()), 5.0f);
    const Rgb expected = white->eval(wo, wi, kUv) * (base + (1.0f - base) * weight);
    CHECK((metal->eval(wo, wi, kUv) - expected).abs().maxCoeff() <= 1e-4f * (1e-3f + expected.maxCoeff()));
  }
  // An anisotropy of 0.8 means an aspect ratio of √0.28.
  const double aspect = std::sqrt(1.0 - 0.9 * 0.8);
  const BsdfPtr brushed =
      principled({{"metallic", 1.0}, {"roughness", 0.6}, {"base_color", 1.0}, {"anisotropic", 0.8}});
  const BsdfPtr same = bsdfOf("roughconductor", {{"alpha_u", 0.36 / aspect},
                                                 {"alpha_v", 0.36 * aspect},
                                                 {"distribution", std::string("ggx")},
                                                 {"material", std::string("none")}});
  const Vec3 wo = directionAt(50.0, 30.0);
  const Vec3 wi = directionAt(20.0, 120.0);
  CHECK(brushed->eval(wo, wi, kUv).isApprox(same->eval(wo, wi, kUv), 1e-4f));
  CHECK(brushed->lobes()[0]->kind() == LobeKind::anisotropic);
}

TEST_CASE("materials: the principled interface is a dielectric of the index implied by specular") {
  // specular 0.5 implies an index of 1.5 and a reflectance of 0.04. Black base, roughness 1, normal incidence.
  const Vec3 up = Vec3::UnitZ();
  const double density = 0.25 / std::numbers::pi;  // D / 4 for α = 1
  for (const BsdfPtr& bsdf : {principled({{"base_color", 0.0}, {"roughness", 1.0}}),
                              principled({{"base_color", 0.0}, {"roughness", 1.0}, {"eta", 1.5}})})
    CHECK(bsdf->eval(up, up, kUv).x() == Approx(0.04 * density).epsilon(1e-4));
  // With full tint the reflectance has the hue of the base colour: red at luminance 1.
  const BsdfPtr red =
      principled({{"base_color", Rgb(0.5f, 0.0f, 0.0f)}, {"roughness", 1.0}, {"spec_tint", 1.0}, {"spec_trans", 0.0}});
  CHECK(red->eval(up, up, kUv).x() - 0.5 * kInvPi == Approx(0.04 / 0.212671 * density).epsilon(1e-3));
  CHECK(red->eval(up, up, kUv).z() == Approx(0.0).margin(1e-7));
}

TEST_CASE("materials: the diffuse and sheen terms of principled match closed forms") {
  const Vec3 up = Vec3::UnitZ();
  CHECK(withoutInterface(0.7, 0.0, 0.6, 0.0)->eval(up, up, kUv).x() == Approx(0.6 * kInvPi));
  CHECK(withoutInterface(0.7, 1.0, 0.6, 0.0)->eval(up, up, kUv).x() == Approx(0.625 * 0.6 * kInvPi));
  // Both directions at 60 degrees, opposite: Schlick's weights are 1/32, the cosine of half the angle between them is
  // 1/2.
  const Vec3 wo = directionAt(60.0, 0.0);
  const Vec3 wi = directionAt(60.0, 180.0);
  const double w = 1.0 / 32.0;
  const double rr = 2.0 * 0.7 * 0.25;
  const double plain = std::pow(1.0 - 0.5 * w, 2) + rr * (2.0 * w + w * w * (rr - 1.0));
  CHECK(withoutInterface(0.7, 0.0, 0.6, 0.0)->eval(wo, wi, kUv).x() == Approx(plain * 0.6 * kInvPi));
  const double ss = std::pow(1.0 + w * (0.5 * rr - 1.0), 2);
  const double flat = 1.25 * (ss * (1.0 - 0.5) + 0.5);
  CHECK(withoutInterface(0.7, 1.0, 0.6, 0.0)->eval(wo, wi, kUv).x() == Approx(flat * 0.6 * kInvPi));
  CHECK(withoutInterface(0.7, 0.4, 0.6, 0.0)->eval(wo, wi, kUv).x() ==
        Approx((0.6 * plain + 0.4 * flat) * 0.6 * kInvPi));
  CHECK(withoutInterface(0.7, 0.0, 0.0, 0.5)->eval(wo, wi, kUv).x() == Approx(0.5 * w));
}

TEST_CASE("materials: the clear coat of principled matches the closed form") {
  const BsdfPtr coated = principled({{"base_color", 0.0}, {"specular", 0.0}, {"clearcoat", 0.8}});
  const double a2 = 0.01;
  const auto density = [&](double cosine2) {
    return (a2 - 1.0) / (std::numbers::pi * std::log(a2) * (1.0 + (a2 - 1.0) * cosine2));
  };
  const Vec3 up = Vec3::UnitZ();
  CHECK(coated->eval(up, up, kUv).x() == Approx(0.25 * 0.8 * 0.04 * density(1.0)).epsilon(1e-4));
  // 60 degrees and the normal: the half vector is at 30 degrees.
  const double fresnel = 0.04 + 0.96 * std::pow(1.0 - std::cos(std::numbers::pi / 6.0), 5);
  const double shadowing = 2.0 / (1.0 + std::sqrt(1.0 + 0.0625 * 3.0));
  CHECK(coated->eval(up, directionAt(60.0), kUv).x() ==
        Approx(0.25 * 0.8 * fresnel * density(0.75) * shadowing).epsilon(1e-4));
  REQUIRE(coated->lobes().size() == 2);
  CHECK(coated->mixture(up, kUv).glossyCount == 2);
  CHECK(coated->mixture(up, kUv).glossy[1].lobe == 1);
  CHECK(coated->mixture(up, kUv).glossy[1].tint == Approx(0.2f));
}

TEST_CASE("materials: principled glass conserves energy and is reciprocal up to the squared index") {
  const BsdfPtr glass = principled({{"base_color", 1.0}, {"spec_trans", 1.0}, {"eta", 1.5}, {"roughness", 0.15}});
  CHECK(glass->transmits());
  Rng rng(52);
  for (const double elevation : {10.0, 50.0, 130.0, 170.0}) {
    const Vec3 wo = directionAt(elevation, 15.0);
    const double eta = wo.z() > 0.0f ? 1.5 : 1.0 / 1.5;
    Mean energy, reflected;
    for (int i = 0; i < 20000; ++i) {
      const float choice = rng.uniform();
      const auto s = glass->sample(wo, kUv, choice, rng.uniform2());
      const double value = s ? s->f.x() * std::abs(s->wi.z()) / s->pdf : 0.0;
      const bool crossed = s && s->wi.z() * wo.z() < 0.0f;
      if (s) CHECK(s->eta == Approx(crossed ? eta : 1));
      energy.add(crossed ? value * eta * eta : value);
      reflected.add(crossed ? 0.0 : value);
      if (!crossed || i >= 200) continue;
      const double there = s->f.x();
      const double back = glass->eval(s->wi, wo, kUv).x();
      CHECK(there * eta * eta == Approx(back).epsilon(2e-3));
    }
    INFO(elevation);
    CHECK(energy.value() <= 1.0 + 4.0 * energy.error());
    CHECK(energy.value() > 0.98);
    CHECK(luminance(glass->albedo(wo, kUv)) == Approx(1.0).margin(0.02));
    CHECK(glass->mixture(wo, kUv).undescribedFraction == Approx(1.0 - reflected.value()).margin(0.02));
  }
  CHECK(principled({{"spec_trans", 1.0}, {"specular", 0.0}})->transmits());
}

TEST_CASE("materials: an opaque principled surface is black from behind") {
  const BsdfPtr bsdf = principled({{"clearcoat", 1.0}, {"sheen", 1.0}});
  const Vec3 below = directionAt(150.0);
  CHECK_FALSE(bsdf->transmits());
  CHECK(bsdf->eval(below, below, kUv).maxCoeff() == 0.0f);
  CHECK(bsdf->eval(-below, below, kUv).maxCoeff() == 0.0f);
  CHECK(bsdf->pdf(below, below, kUv) == 0.0f);
  CHECK_FALSE(bsdf->sample(below, kUv, 0.5f, Vec2(0.5f, 0.5f)));
  CHECK(bsdf->mixture(below, kUv).glossyCount == 0);
  CHECK(bsdf->albedo(below, kUv).maxCoeff() == 0.0f);
  CHECK(bsdf->mixture(-below, kUv).undescribedFraction == 0.0f);
}

TEST_CASE("materials: principled is finite at the limits of its parameters") {
  Rng rng(53);
  const float edges[] = {0.0f, 1e-30f, -1e-30f, 1e-6f, -1e-6f, 1.0f, -1.0f};
  for (const double roughness : {0.0, 1.0})
    for (const double all : {0.0, 0.5, 1.0})
      for (const double eta : {0.5, 1.0, 3.0}) {
        const BsdfPtr bsdf = principled({{"roughness", roughness},
                                         {"anisotropic", all},
                                         {"spec_trans", all},
                                         {"metallic", 0.3 * all},
                                         {"sheen", all},
                                         {"sheen_tint", all},
                                         {"flatness", all},
                                         {"clearcoat", all},
                                         {"clearcoat_gloss", all},
                                         {"spec_tint", all},
                                         {"eta", eta}});
        int bad = 0;
        for (int i = 0; i < 500; ++i) {
          Vec3 wo = squareToSphere(rng.uniform2());
          Vec3 wi = i % 3 ? squareToSphere(rng.uniform2()) : Vec3(-wo);
          if (i % 2) wo.z() = edges[rng.next() % std::size(edges)], wo.normalize();
          if (i % 4 > 1) wi.z() = edges[rng.next() % std::size(edges)], wi.normalize();
          const Rgb f = bsdf->eval(wo, wi, kUv);
          const float p = bsdf->pdf(wo, wi, kUv);
          bad += !(f.allFinite() && (f >= 0.0f).all() && std::isfinite(p) && p >= 0.0f);
          const auto s = bsdf->sample(wo, kUv, rng.uniform(), rng.uniform2());
          bad += s && !(s->f.allFinite() && (s->f >= 0.0f).all() && s->pdf > 0.0f && std::isfinite(s->pdf));
          const LobeMixture mixture = bsdf->mixture(wo, kUv);
          bad += !(mixture.constant >= 0.0f && mixture.undescribedFraction >= 0.0f &&
                   mixture.undescribedFraction <= 1.0f && bsdf->albedo(wo, kUv).allFinite());
        }
        INFO(roughness << " " << all << " " << eta);
        CHECK(bad == 0);
      }
}

TEST_CASE("materials: principled surfaces of any colour share a lobe") {
  const auto key = [](Values values) { return principled(values)->lobes()[0]->key(); };
  CHECK(key({{"base_color", 0.1}, {"eta", 1.3}}) == key({{"base_color", 0.9}, {"metallic", 1.0}, {"sheen", 1.0}}));
  CHECK(key({{"roughness", 0.4}}) != key({}));
}

TEST_CASE("materials: errors in principled are reported") {
  using Catch::Matchers::Contains;
  const auto message = [](Values values) {
    try {
      principled(values);
    } catch (const ParameterError& error) {
      return error.name + ": " + error.what();
    }
    return std::string("no error");
  };
  CHECK_THAT(message({{"eta", 1.5}, {"specular", 0.5}}), Contains("either eta or specular"));
  CHECK_THAT(message({{"eta", 0.0}}), Contains("eta: ") && Contains("positive"));
  CHECK_THAT(message({{"specular", 2.0}}), Contains("specular: ") && Contains("2"));
  CHECK_THAT(message({{"roughness", 1.5}}), Contains("roughness: ") && Contains("1.5"));
  CHECK_THAT(message({{"metallic", -0.5}}), Contains("metallic: ") && Contains("-0.5"));
  CHECK_THAT(message({{"clearcoat_sampling_rate", -1.0}}), Contains("clearcoat_sampling_rate: "));
}

}  // namespace lobe
