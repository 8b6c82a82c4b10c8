// Coatings compared with closed forms.

#include <catch2/catch.hpp>

#include "materials/lobes/fresnel.h"
#include "materials/lobes/microfacet.h"
#include "materials/lobes/rough_transmittance.h"
#include "runtime/core/sampling.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

BsdfPtr diffuseOf(double reflectance) {
  return bsdfOf("diffuse", {{"reflectance", reflectance}});
}

BsdfPtr mirrorOf(double reflectance) {
  return bsdfOf("conductor", {{"material", std::string("none")}, {"specular_reflectance", reflectance}});
}

BsdfPtr coated(const BsdfPtr& nested, double eta, double depth = 0.0) {
  return bsdfOf("coating", {{"int_ior", eta}, {"ext_ior", 1.0}, {"sigma_a", depth / 2.0}, {"thickness", 2.0}},
                {nested});
}

BsdfPtr roughlyCoated(const BsdfPtr& nested, double alpha, double eta, double depth = 0.0) {
  return bsdfOf("roughcoating", {{"int_ior", eta}, {"ext_ior", 1.0}, {"sigma_a", depth}, {"alpha", alpha}}, {nested});
}

double passing(double cosine, double eta) {
  return 1.0 - fresnelDielectric(cosine, eta).reflectance;
}

double cosineInside(double cosine, double eta) {
  return std::sqrt(1.0 - (1.0 - cosine * cosine) / (eta * eta));
}

/// The albedo estimated with the model's own sampler.
Mean sampledAlbedo(const Bsdf& bsdf, const Vec3& wo, int samples) {
  Rng rng(21);
  Mean albedo;
  for (int i = 0; i < samples; ++i) {
    const float delta = bsdf.deltaProbability(wo, kUv);
    if (rng.uniform() < delta) {
      const auto s = bsdf.sampleDelta(wo, kUv, rng.uniform());
      albedo.add(s ? luminance(s->weight) / delta : 0.0);
    } else {
      const float choice = rng.uniform();
      const auto s = bsdf.sample(wo, kUv, choice, rng.uniform2());
      albedo.add(s ? luminance(s->f) * std::abs(s->wi.z()) / (s->pdf * (1.0f - delta)) : 0.0);
    }
  }
  return albedo;
}

}  // namespace

TEST_CASE("materials: a coating with the index of the outside equals its nested model") {
  const BsdfPtr shiny = bsdfOf("twosided", {}, {bsdfOf("roughplastic", {{"alpha", 0.2}})});
  const BsdfPtr clear = coated(shiny, 1.0);
  Rng rng(22);
  for (int i = 0; i < 500; ++i) {
    const Vec3 wo = squareToSphere(rng.uniform2());
    const Vec3 wi = squareToSphere(rng.uniform2());
    CHECK((clear->eval(wo, wi, kUv) - shiny->eval(wo, wi, kUv)).abs().maxCoeff() <=
          1e-3f * shiny->eval(wo, wi, kUv).maxCoeff());
    CHECK(clear->pdf(wo, wi, kUv) == Approx(shiny->pdf(wo, wi, kUv)).epsilon(1e-3));
    CHECK(clear->deltaProbability(wo, kUv) == Approx(0.0).margin(1e-6));
  }
  const Vec3 wo = directionAt(50.0, 30.0);
  const auto mirrored = coated(mirrorOf(0.7), 1.0)->sampleDelta(wo, kUv, 0.5f);
  REQUIRE(mirrored);
  CHECK(mirrored->weight.x() == Approx(0.7f));
  CHECK(mirrored->wi.isApprox(Vec3(-wo.x(), -wo.y(), wo.z()), 1e-5f));
}

TEST_CASE("materials: a coating over black has only its own reflection") {
  const BsdfPtr smooth = coated(diffuseOf(0.0), 1.5);
  const BsdfPtr rough = roughlyCoated(diffuseOf(0.0), 0.3, 1.5);
  const Microfacet facets(Microfacet::Kind::beckmann, 0.3, 0.3);
  for (const double elevation : {0.0, 40.0, 80.0, 100.0, 150.0}) {
    const Vec3 wo = directionAt(elevation, 30.0);
    CHECK(smooth->deltaProbability(wo, kUv) == 1.0f);
    const auto s = smooth->sampleDelta(wo, kUv, 0.99f);
    REQUIRE(s);
    CHECK(s->weight.x() == Approx(1.0 - passing(std::abs(wo.z()), 1.5)));
    CHECK(s->wi.isApprox(Vec3(-wo.x(), -wo.y(), wo.z())));
    for (const double other : {10.0, 60.0}) {
      const float side = std::copysign(1.0f, wo.z());
      const Vec3 up = directionAt(other, 170.0);
      double cosHalf = 0.0;
      const double value = facets.reflection(Vec3(wo.x(), wo.y(), side * wo.z()), up, &cosHalf);
      CHECK(rough->eval(wo, Vec3(up.x(), up.y(), side * up.z()), kUv).x() ==
            Approx(value * fresnelDielectric(cosHalf, 1.5).reflectance).margin(1e-9));
    }
  }
}

TEST_CASE("materials: a coated diffuse surface matches the closed form") {
  constexpr double kEta = 1.6, kDepth = 0.3;
  const BsdfPtr smooth = coated(diffuseOf(0.8), kEta, kDepth);
  const BsdfPtr rough = roughlyCoated(diffuseOf(0.8), 0.25, kEta, kDepth);
  const RoughTransmittance table(Microfacet(Microfacet::Kind::beckmann, 0.25, 0.25), kEta);
  const BsdfPtr facets = roughlyCoated(diffuseOf(0.0), 0.25, kEta);
  for (const double elevation : {0.0, 35.0, 85.0}) {
    const Vec3 wo = directionAt(elevation, 20.0);
    const Vec3 wi = directionAt(55.0, 140.0);
    const double o = wo.z(), i = wi.z();
    const double absorbed = std::exp(-kDepth * (1.0 / cosineInside(o, kEta) + 1.0 / cosineInside(i, kEta)));
    const double inside = 0.8 / std::numbers::pi * absorbed / (kEta * kEta);
    CHECK(smooth->eval(wo, wi, kUv).x() == Approx(inside * passing(o, kEta) * passing(i, kEta)).epsilon(1e-4));
    const double own = facets->eval(wo, wi, kUv).x();
    CHECK(rough->eval(wo, wi, kUv).x() ==
          Approx(own + inside * table(static_cast<float>(o)) * table(static_cast<float>(i))).epsilon(1e-4));
  }
}

TEST_CASE("materials: a coated mirror matches the closed form") {
  constexpr double kEta = 1.5, kDepth = 0.4;
  const BsdfPtr bsdf = coated(mirrorOf(0.9), kEta, kDepth);
  for (const double elevation : {0.0, 50.0, 80.0}) {
    const Vec3 wo = directionAt(elevation, 20.0);
    const double pass = passing(wo.z(), kEta);
    const double expected = 1.0 - pass + 0.9 * pass * pass * std::exp(-2.0 * kDepth / cosineInside(wo.z(), kEta));
    CHECK(bsdf->deltaProbability(wo, kUv) == 1.0f);
    double sum = 0.0;
    constexpr int kChoices = 20000;
    for (int i = 0; i < kChoices; ++i) {
      const auto s = bsdf->sampleDelta(wo, kUv, (static_cast<float>(i) + 0.5f) / kChoices);
      REQUIRE(s);
      sum += s->weight.x() / kChoices;
    }
    CHECK(sum == Approx(expected).epsilon(1e-3));
    CHECK(bsdf->albedo(wo, kUv).x() == Approx(expected).epsilon(1e-4));
  }
}

TEST_CASE("materials: a coated white surface loses the light that the coating reflects internally") {
  for (const double eta : {0.8, 1.3, 1.8}) {
    const BsdfPtr smooth = coated(diffuseOf(1.0), eta);
    const Vec3 wo = directionAt(40.0, 10.0);
    // The fraction 1 − F̄(1/η) of diffuse light from inside leaves the coating.
    const double expected = 1.0 - passing(wo.z(), eta) * fresnelDiffuse(1.0 / eta);
    const Mean found = sampledAlbedo(*smooth, wo, 40000);
    CHECK(found.value() == Approx(expected).margin(4.0 * found.error()));
    CHECK(smooth->albedo(wo, kUv).x() == Approx(expected).margin(0.01));
  }
}

TEST_CASE("materials: the albedo of coated glossy surfaces matches sampling") {
  // Narrow, so that no part of the lobe is totally reflected inside the coating.
  const BsdfPtr metal = bsdfOf("roughconductor", {{"alpha", 0.02}, {"material", std::string("Ag")}});
  const BsdfPtr plastic = bsdfOf("plastic");
  const std::initializer_list<BsdfPtr> models = {coated(metal, 1.5, 0.1), roughlyCoated(metal, 0.1, 1.5),
                                                 coated(plastic, 1.4), roughlyCoated(plastic, 0.2, 1.4, 0.2),
                                                 roughlyCoated(mirrorOf(0.9), 0.2, 1.5)};
  for (const BsdfPtr& bsdf : models)
    for (const double elevation : {0.0, 60.0}) {
      const Vec3 wo = directionAt(elevation, 70.0);
      const Mean found = sampledAlbedo(*bsdf, wo, 20000);
      INFO("model " << &bsdf - models.begin() << " at " << elevation);
      CHECK(found.value() < 1.0);
      CHECK(luminance(bsdf->albedo(wo, kUv)) == Approx(found.value()).margin(0.03));
    }
  // The mixture describes only the coating and not the metal below.
  CHECK(coated(metal, 1.5)->lobes().empty());
  CHECK(coated(metal, 1.5)->mixture(Vec3::UnitZ(), kUv).undescribedFraction == 1.0f);
  const LobeMixture rough = roughlyCoated(metal, 0.1, 1.5)->mixture(Vec3::UnitZ(), kUv);
  CHECK(rough.glossyCount == 1);
  CHECK(rough.undescribedFraction > 0.9f);
  CHECK(rough.undescribedFraction < 1.0f);
  CHECK(coated(diffuseOf(0.5), 1.5)->mixture(Vec3::UnitZ(), kUv).undescribedFraction == 0.0f);
}

TEST_CASE("materials: errors in coatings are reported") {
  const auto messageOf = [](const std::string& type,
                            std::initializer_list<std::pair<std::string, ParameterValue>> values,
                            std::initializer_list<BsdfPtr> children) -> std::string {
    try {
      bsdfOf(type, values, children);
    } catch (const ParameterError& error) {
      return error.name + ": " + error.what();
    }
    return "no error";
  };
  using Catch::Matchers::Contains;
  for (const std::string type : {"coating", "roughcoating"}) {
    CHECK_THAT(messageOf(type, {}, {}), Contains("one nested bsdf"));
    CHECK_THAT(messageOf(type, {{"thickness", -1.0}}, {diffuseOf(0.5)}), Contains("thickness"));
    CHECK_THAT(messageOf(type, {{"sigma_a", -1.0}}, {diffuseOf(0.5)}), Contains("sigma_a"));
  }
  CHECK_THAT(messageOf("roughcoating", {{"alpha_u", 0.1}, {"alpha_v", 0.2}}, {diffuseOf(0.5)}), Contains("isotropic"));
  const Parameters bumpy = parametersOf({}, {bsdfOf("bumpmap", {{"", constantTexture(grey(1.0f))}}, {diffuseOf(0.5)})});
  makeBsdf("coating", bumpy);
  REQUIRE(bumpy.warnings().size() == 1);
  CHECK_THAT(bumpy.warnings()[0].text, Contains("mapped normals"));
}

}  // namespace lobe
