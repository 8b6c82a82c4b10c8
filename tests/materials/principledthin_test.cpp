// The principled model of thin surfaces compared with its parts.

#include <catch2/catch.hpp>

#include "materials/lobes/fresnel.h"
#include "materials/lobes/microfacet.h"
#include "runtime/core/sampling.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

Vec3 flipped(const Vec3& w) {
  return {w.x(), w.y(), -w.z()};
}

}  // namespace

TEST_CASE("materials: principledthin without transmission equals the diffuse part of principled on both sides") {
  const std::initializer_list<std::pair<std::string, ParameterValue>> shared = {{"base_color", Rgb(0.8f, 0.5f, 0.2f)},
                                                                                {"roughness", 0.7},
                                                                                {"flatness", 0.4},
                                                                                {"sheen", 0.5},
                                                                                {"sheen_tint", 0.3}};
  const BsdfPtr thin = bsdfOf("principledthin", shared);
  Parameters withoutInterface = parametersOf(shared);
  withoutInterface.set("eta", 1.0);
  const BsdfPtr thick = makeBsdf("principled", withoutInterface);
  CHECK_FALSE(thin->transmits());
  CHECK(thin->lobes().empty());
  Rng rng(61);
  for (int i = 0; i < 200; ++i) {
    const Vec3 wo = squareToCosineHemisphere(rng.uniform2());
    const Vec3 wi = squareToCosineHemisphere(rng.uniform2());
    CHECK(thin->eval(wo, wi, kUv).isApprox(thick->eval(wo, wi, kUv), 1e-4f));
    CHECK(thin->eval(flipped(wo), flipped(wi), kUv).isApprox(thin->eval(wo, wi, kUv), 1e-4f));
    CHECK(thin->eval(wo, flipped(wi), kUv).maxCoeff() == 0.0f);
  }
}

TEST_CASE("materials: principledthin transmits half of diff_trans of its diffuse light") {
  const Vec3 wo = directionAt(30.0);
  const Vec3 below = directionAt(120.0, 50.0);
  const auto thin = [](double transmission) {
    return bsdfOf("principledthin", {{"base_color", 0.6}, {"diff_trans", transmission}});
  };
  const float whole = thin(0.0)->eval(wo, Vec3::UnitZ(), kUv).x();
  CHECK(thin(0.5)->eval(wo, Vec3::UnitZ(), kUv).x() == Approx(0.75f * whole));
  CHECK(thin(0.5)->eval(wo, below, kUv).x() == Approx(0.25 * 0.6 * kInvPi));
  CHECK(thin(2.0)->eval(wo, Vec3::UnitZ(), kUv).x() == 0.0f);
  CHECK(thin(2.0)->eval(wo, below, kUv).x() == Approx(0.6 * kInvPi));
  CHECK(thin(2.0)->transmits());
  CHECK(thin(2.0)->mixture(wo, kUv).undescribedFraction == 1.0f);
}

TEST_CASE("materials: the interface of principledthin matches microfacet reflection and transmission") {
  constexpr double kEta = 1.4, kRoughness = 0.6;
  const BsdfPtr thin =
      bsdfOf("principledthin",
             {{"base_color", Rgb(0.9f, 0.6f, 0.3f)}, {"roughness", kRoughness}, {"spec_trans", 1.0}, {"eta", kEta}});
  const Microfacet reflecting(Microfacet::Kind::ggx, 0.36, 0.36);
  const double scaled = (0.65 * kEta - 0.35) * kRoughness;
  const Microfacet transmitting(Microfacet::Kind::ggx, scaled * scaled, scaled * scaled);
  const Vec3 wo = directionAt(40.0, 10.0);
  for (const double azimuth : {100.0, 190.0}) {
    const Vec3 wi = directionAt(35.0, azimuth);
    double cosHalf = 0.0;
    const double facets = reflecting.reflection(wo, wi, &cosHalf);
    const double fresnel = fresnelDielectric(cosHalf, kEta).reflectance;
    CHECK(thin->eval(wo, wi, kUv).isApprox(grey(static_cast<float>(facets * fresnel)), 1e-4f));
    const double through = transmitting.reflection(wo, wi) * (1.0 - fresnel);
    CHECK(thin->eval(wo, flipped(wi), kUv).isApprox(Rgb(0.9f, 0.6f, 0.3f) * static_cast<float>(through), 1e-4f));
  }
  // A facet does not transmit light to the side from which it came.
  const Vec3 grazing = directionAt(88.0, 10.0);
  CHECK(thin->eval(grazing, flipped(directionAt(89.0, 12.0)), kUv).maxCoeff() == 0.0f);
}

TEST_CASE("materials: a clear thin sheet conserves energy") {
  const BsdfPtr sheet =
      bsdfOf("principledthin", {{"base_color", 1.0}, {"roughness", 0.15}, {"spec_trans", 1.0}, {"eta", 1.5}});
  const Vec3 wo = directionAt(30.0);
  Rng rng(62);
  Mean albedo;
  for (int i = 0; i < 20000; ++i) {
    const float choice = rng.uniform();
    const auto s = sheet->sample(wo, kUv, choice, rng.uniform2());
    albedo.add(s ? s->f.x() * std::abs(s->wi.z()) / s->pdf : 0.0);
    if (s) CHECK(s->eta == 1.0f);
  }
  CHECK(albedo.value() == Approx(1.0).margin(4.0 * albedo.error() + 2e-3));
  CHECK(sheet->lobes().size() == 1);
}

TEST_CASE("materials: errors in principledthin are reported") {
  const auto messageOf = [](const std::string& name, double value) -> std::string {
    try {
      bsdfOf("principledthin", {{name, value}});
    } catch (const ParameterError& error) {
      return error.name + ": " + error.what();
    }
    return "no error";
  };
  for (const std::string name : {"roughness", "diff_trans", "spec_trans"})
    CHECK_THAT(messageOf(name, 2.5), Catch::Contains(name + " must be in"));
  CHECK_THAT(messageOf("eta", 0.0), Catch::Contains("positive"));
  CHECK(messageOf("diff_trans", 2.0) == "no error");
}

}  // namespace lobe
