// Reflectances above 1: scaling and warnings.

#include <catch2/catch.hpp>

#include "materials/textures/checkerboard.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

using Catch::Matchers::Contains;

/// A model and the warnings from its creation.
struct Created {
  BsdfPtr bsdf;
  std::vector<Parameters::Warning> warnings;
};

enum class Ensured { yes, no, unset };

Created made(const std::string& type, Parameters parameters, Ensured ensured) {
  if (ensured != Ensured::unset) parameters.set("ensure_energy_conservation", ensured == Ensured::yes);
  const BsdfPtr bsdf = makeBsdf(type, parameters);
  return {bsdf, parameters.warnings()};
}

const Vec3 kUp = Vec3::UnitZ();

}  // namespace

TEST_CASE("materials: a reflectance above 1 is scaled if energy conservation is ensured and reported otherwise") {
  const Parameters bright = parametersOf({{"reflectance", Rgb(0.5f, 255.0f, 2.55f)}});
  const Created scaled = made("diffuse", bright, Ensured::yes);
  CHECK(scaled.bsdf->albedo(kUp, kUv).isApprox(Rgb(0.5f, 255.0f, 2.55f) * 0.99f / 255.0f, 1e-5f));
  REQUIRE(scaled.warnings.size() == 1);
  CHECK(scaled.warnings[0].name == "reflectance");
  CHECK_THAT(scaled.warnings[0].text, Contains("255") && Contains("scaled by 0.003882"));
  const Created kept = made("diffuse", bright, Ensured::unset);
  CHECK(kept.bsdf->albedo(kUp, kUv).y() == 255.0f);
  REQUIRE(kept.warnings.size() == 1);
  CHECK_THAT(kept.warnings[0].text, Contains("255") && Contains("kept"));
  const Created wanted = made("diffuse", bright, Ensured::no);
  CHECK(wanted.bsdf->albedo(kUp, kUv).y() == 255.0f);
  CHECK(wanted.warnings.empty());
  CHECK(made("diffuse", parametersOf({{"reflectance", 1.0}}), Ensured::yes).bsdf->albedo(kUp, kUv).x() == 1.0f);
}

TEST_CASE("materials: the largest component of a texture determines the scale") {
  // The luminance of this red is only 0.43.
  const TexturePtr board = makeCheckerboard(constantTexture(Rgb(2.0f, 0.0f, 0.0f)), constantTexture(grey(0.5f)));
  const Created scaled = made("diffuse", parametersOf({{"reflectance", board}}), Ensured::yes);
  CHECK(scaled.warnings.size() == 1);
  CHECK(scaled.bsdf->albedo(kUp, Vec2(0.25f, 0.25f)).isApprox(Rgb(0.99f, 0.0f, 0.0f)));
  CHECK(scaled.bsdf->albedo(kUp, Vec2(0.75f, 0.25f)).isApprox(grey(0.2475f)));
}

TEST_CASE("materials: all reflectances and transmittances are checked and no other parameters") {
  const BsdfPtr nested = bsdfOf("diffuse");
  const std::pair<const char*, const char*> colours[] = {
      {"diffuse", "reflectance"},
      {"roughdiffuse", "reflectance"},
      {"difftrans", "transmittance"},
      {"conductor", "specular_reflectance"},
      {"roughconductor", "specular_reflectance"},
      {"dielectric", "specular_reflectance"},
      {"dielectric", "specular_transmittance"},
      {"thindielectric", "specular_reflectance"},
      {"thindielectric", "specular_transmittance"},
      {"roughdielectric", "specular_reflectance"},
      {"roughdielectric", "specular_transmittance"},
      {"plastic", "diffuse_reflectance"},
      {"plastic", "specular_reflectance"},
      {"roughplastic", "diffuse_reflectance"},
      {"roughplastic", "specular_reflectance"},
      {"phong", "specular_reflectance"},
      {"ward", "diffuse_reflectance"},
      {"principled", "base_color"},
      {"principledthin", "base_color"},
      {"mask", "opacity"},
      {"coating", "specular_reflectance"},
      {"roughcoating", "specular_reflectance"},
  };
  for (const auto& [type, name] : colours) {
    INFO(type << " " << name);
    Parameters parameters = parametersOf({{name, 3.0}});
    const std::string_view holder = type;
    if (holder == "mask" || holder.ends_with("coating")) parameters.addChild(nested);
    for (const Ensured ensured : {Ensured::yes, Ensured::unset}) {
      const Created created = made(type, parameters, ensured);
      REQUIRE(created.warnings.size() == 1);
      CHECK_THAT(created.warnings[0].text, Contains(name) && Contains("up to 3"));
    }
  }
  CHECK(made("roughconductor", parametersOf({{"alpha", 2.0}, {"eta", grey(3.0f)}, {"k", grey(5.0f)}}), Ensured::yes)
            .warnings.empty());
}

TEST_CASE("materials: the sum of the colours of Phong and Ward is bounded") {
  for (const char* type : {"phong", "ward"}) {
    const Created created =
        made(type, parametersOf({{"specular_reflectance", 0.9}, {"diffuse_reflectance", 0.6}}), Ensured::yes);
    const LobeMixture mixture = created.bsdf->mixture(kUp, kUv);
    CHECK(mixture.glossy[0].tint == Approx(0.9 * 0.99 / 1.5));
    CHECK(mixture.constant == Approx(0.6 * 0.99 / 1.5));
    REQUIRE(created.warnings.size() == 1);
    CHECK(created.warnings[0].name == "specular_reflectance");
  }
}

TEST_CASE("materials: plastic of any reflectance stays finite and positive") {
  for (const double reflectance : {1.5, 255.0}) {
    const BsdfPtr plastic = bsdfOf("plastic", {{"diffuse_reflectance", reflectance}, {"nonlinear", true}});
    const Rgb value = plastic->eval(kUp, directionAt(30.0), kUv);
    CHECK(value.allFinite());
    CHECK(value.minCoeff() > 0.0f);
  }
}

TEST_CASE("materials: mixture weights with a sum above 1 are kept or scaled with a warning") {
  const std::vector<BsdfPtr> parts = {
      bsdfOf("conductor", {{"material", std::string("none")}, {"specular_reflectance", 0.08}}),
      bsdfOf("diffuse", {{"reflectance", 0.9}})};
  Parameters parameters = parametersOf({{"weights", std::string("1, 1")}}, {parts[0], parts[1]});
  const Created given = made("mixturebsdf", parameters, Ensured::no);
  CHECK(given.warnings.empty());
  const Vec3 wo = directionAt(40.0);
  CHECK(given.bsdf->albedo(wo, kUv).x() == Approx(0.98f));
  CHECK(given.bsdf->eval(wo, kUp, kUv).x() == Approx(0.9 / std::numbers::pi));
  const float delta = given.bsdf->deltaProbability(wo, kUv);
  CHECK(delta == Approx(0.5f));
  const auto mirrored = given.bsdf->sampleDelta(wo, kUv, 0.5f);
  REQUIRE(mirrored);
  CHECK(mirrored->weight.x() == Approx(0.08f));
  const auto diffuse = given.bsdf->sample(wo, kUv, 0.5f, Vec2(0.3f, 0.6f));
  REQUIRE(diffuse);
  CHECK(diffuse->f.x() * diffuse->wi.z() / diffuse->pdf == Approx(0.9f));
  for (const Ensured ensured : {Ensured::yes, Ensured::unset}) {
    const Created scaled = made("mixturebsdf", parameters, ensured);
    CHECK(scaled.bsdf->albedo(wo, kUv).x() == Approx(0.49f));
    REQUIRE(scaled.warnings.size() == 1);
    CHECK(scaled.warnings[0].name == "weights");
    CHECK_THAT(scaled.warnings[0].text, Contains("sum of weights is 2"));
  }
}

}  // namespace lobe
