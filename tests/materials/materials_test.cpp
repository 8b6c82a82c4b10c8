// Parameters, registry, Fresnel equations, keys of lobes, sides and bump maps.

#include <catch2/catch.hpp>

#include <algorithm>

#include "materials/lobes/fresnel.h"
#include "runtime/core/frame.h"
#include "runtime/core/sampling.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

using Catch::Matchers::Contains;

/// A height field for bump maps: h = 0.05 sin(4u) + 0.03 cos(3v).
class Waves final : public Texture {
 public:
  Rgb eval(const Vec2& uv) const override {
    return grey(0.05f * std::sin(4.0f * uv.x()) + 0.03f * std::cos(3.0f * uv.y()));
  }
  Rgb mean() const override { return Rgb::Zero(); }
  TextureRange range() const override { return {-0.08f, 0.08f}; }
  Rgb largest() const override { return grey(0.08f); }
  std::uint64_t fingerprint() const override { return 0; }
};

std::string messageOf(const std::string& type,
                      std::initializer_list<std::pair<std::string, ParameterValue>> values = {},
                      std::initializer_list<BsdfPtr> children = {}) {
  try {
    makeBsdf(type, parametersOf(values, children));
  } catch (const ParameterError& error) {
    return error.name + ": " + error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("materials: parameters check types and return fallbacks and record which were used") {
  Parameters p;
  p.set("number", 2.5, 40);
  p.set("flag", true);
  p.set("name", std::string("gold"));
  p.set("tint", Rgb(0.1f, 0.2f, 0.3f));
  p.set("forgotten", 1.0);
  CHECK(p.number("number", 0.0) == 2.5);
  CHECK(p.number("missing", 7.0) == 7.0);
  CHECK(p.flag("flag", false));
  CHECK(p.text("name", "") == "gold");
  CHECK(p.colour("number", Rgb::Zero()).y() == 2.5f);
  CHECK(p.texture("tint", Rgb::Zero())->eval(kUv).z() == 0.3f);
  CHECK(p.texture("missing", grey(0.5f))->mean().x() == 0.5f);
  CHECK(p.transform("missing").isIdentity());
  CHECK(p.location("number") == 40);
  CHECK(p.location("missing") == 0);
  CHECK(p.unused() == std::vector<std::string>{"forgotten"});
  CHECK_THROWS_AS(p.number("name", 0.0), ParameterError);
  CHECK_THROWS_AS(p.flag("number", false), ParameterError);
  CHECK_THROWS_AS(p.texture("name", Rgb::Zero()), ParameterError);
  CHECK_THROWS_AS(p.onlyChild(), ParameterError);
  CHECK_THROWS_AS(p.onlyTexture(), ParameterError);
}

TEST_CASE("materials: the registry creates its models and lists them if the type is unknown") {
  const std::vector<std::string> known = knownBsdfs();
  CHECK(std::is_sorted(known.begin(), known.end()));
  for (const char* type : {"conductor", "dielectric", "diffuse", "plastic", "roughconductor", "roughplastic"})
    CHECK(bsdfOf(type) != nullptr);
  const std::string message = messageOf("velvet");
  CHECK_THAT(message, Contains("velvet"));
  for (const std::string& type : known) CHECK_THAT(message, Contains(type));
}

TEST_CASE("materials: invalid parameters are rejected with the valid alternatives") {
  CHECK_THAT(messageOf("roughconductor", {{"distribution", std::string("blinn")}}),
             Contains("distribution:") && Contains("blinn") && Contains("beckmann, ggx"));
  CHECK_THAT(messageOf("roughconductor", {{"alpha", -0.1}}), Contains("alpha:"));
  CHECK_THAT(messageOf("roughconductor", {{"alpha", std::nan("")}}), Contains("alpha:"));
  CHECK_THAT(messageOf("roughconductor", {{"alpha", 0.1}, {"alpha_u", 0.1}, {"alpha_v", 0.1}}), Contains("either"));
  CHECK_THAT(messageOf("roughconductor", {{"material", std::string("Unobtainium")}}), Contains("Au") && Contains("Cu"));
  CHECK_THAT(messageOf("roughconductor", {{"alpha", grey(0.1f)}}), Contains("number"));
  CHECK_THAT(messageOf("roughplastic", {{"int_ior", std::string("jelly")}}), Contains("bk7") && Contains("water"));
  CHECK_THAT(messageOf("roughplastic", {{"int_ior", -1.0}}), Contains("positive"));
  CHECK_THAT(messageOf("roughplastic", {{"alpha_u", 0.1}, {"alpha_v", 0.2}}), Contains("isotropic"));
  CHECK_THAT(messageOf("twosided"), Contains("nested"));
  CHECK_THAT(messageOf("twosided", {}, {bsdfOf("dielectric")}), Contains("transmits"));
  CHECK_THAT(messageOf("mask"), Contains("nested"));
  CHECK_THAT(messageOf("bumpmap", {}, {bsdfOf("diffuse")}), Contains("texture"));
}

TEST_CASE("materials: models use all of their parameters so that unknown ones are found") {
  const auto unused = [](const std::string& type, Parameters p) {
    makeBsdf(type, p);
    return p.unused();
  };
  const std::string ggx = "ggx";
  CHECK(unused("roughconductor", parametersOf({{"distribution", ggx},
                                               {"alpha", 0.1},
                                               {"ext_eta", 1.0},
                                               {"specular_reflectance", grey(1.0f)},
                                               {"eta", grey(1.0f)},
                                               {"k", grey(2.0f)},
                                               {"sample_visible", true}}))
            .empty());
  CHECK(unused("roughplastic", parametersOf({{"distribution", ggx},
                                             {"alpha", 0.1},
                                             {"int_ior", 1.5},
                                             {"ext_ior", 1.0},
                                             {"nonlinear", true},
                                             {"diffuse_reflectance", grey(0.1f)}}))
            .empty());
  CHECK(unused("diffuse", parametersOf({{"reflectanse", 0.1}})) == std::vector<std::string>{"reflectanse"});
}

TEST_CASE("materials: negative indices of metals are replaced by absolute values with a note") {
  const Parameters p =
      parametersOf({{"eta", Rgb(-0.05f, 4.1f, 4.7f)}, {"k", Rgb(-0.04f, 0.09f, 1.3f)}, {"alpha", 0.1}});
  const BsdfPtr metal = makeBsdf("roughconductor", p);
  const BsdfPtr plain =
      bsdfOf("roughconductor", {{"eta", Rgb(0.05f, 4.1f, 4.7f)}, {"k", Rgb(0.04f, 0.09f, 1.3f)}, {"alpha", 0.1}});
  const Vec3 wo = directionAt(20.0), wi = directionAt(22.0, 180.0);
  CHECK((metal->eval(wo, wi, kUv) == plain->eval(wo, wi, kUv)).all());
  REQUIRE(p.notes().size() == 2);
  CHECK_THAT(p.notes()[0], Contains("eta") && Contains("-0.05") && Contains("absolute"));
  CHECK_THAT(messageOf("conductor", {{"k", grey(std::nanf(""))}}), Contains("finite"));
}

TEST_CASE("materials: Fresnel reflectances match closed forms") {
  CHECK(fresnelDielectric(1.0, 1.5).reflectance == Approx(0.04));
  CHECK(fresnelDielectric(0.0, 1.5).reflectance == Approx(1.0));
  CHECK(fresnelDielectric(0.5, 1.0 / 1.5).reflectance == 1.0);  // beyond the critical angle
  const double brewster = 1.0 / std::sqrt(1.0 + 1.5 * 1.5);
  const double perpendicular = (brewster - 1.5 * std::sqrt(1.0 - (1.0 - brewster * brewster) / 2.25)) /
                               (brewster + 1.5 * std::sqrt(1.0 - (1.0 - brewster * brewster) / 2.25));
  CHECK(fresnelDielectric(brewster, 1.5).reflectance == Approx(0.5 * perpendicular * perpendicular));
  // A metal without absorption is a dielectric.
  for (const float c : {0.01f, 0.3f, 0.8f, 1.0f})
    CHECK(fresnelConductor(c, grey(1.5f), grey(0.0f)).x() ==
          Approx(fresnelDielectric(c, 1.5).reflectance).margin(1e-5));
  CHECK(fresnelConductor(1.0f, grey(0.2f), grey(3.0f)).x() == Approx((0.64 + 9.0) / (1.44 + 9.0)));
  CHECK(fresnelConductor(0.3f, grey(0.0f), grey(1.0f)).x() == Approx(1.0));
  // An index of zero, which occurs in fits to spectra, reflects everything.
  for (const float c : {0.0f, 1e-4f, 0.5f, 1.0f})
    CHECK((fresnelConductor(c, grey(0.0f), grey(0.0f)) - 1.0f).abs().maxCoeff() < 1e-5f);
  CHECK(fresnelConductor(1.0f, grey(1.0f), grey(0.0f)).x() == Approx(0.0f).margin(1e-6));
  // Walsh's closed form of the diffuse reflectance.
  const double n = 1.5, n2 = n * n, n4 = n2 * n2;
  const double walsh = 0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) * (n + 1)) +
                       n2 * (n2 - 1) * (n2 - 1) / std::pow(n2 + 1, 3) * std::log((n - 1) / (n + 1)) -
                       2 * n * n2 * (n2 + 2 * n - 1) / ((n2 + 1) * (n4 - 1)) +
                       8 * n4 * (n4 + 1) / ((n2 + 1) * (n4 - 1) * (n4 - 1)) * std::log(n);
  CHECK(fresnelDiffuse(n) == Approx(walsh).epsilon(1e-5));
  CHECK(fresnelDiffuse(1.0) == Approx(0.0).margin(1e-9));
}

TEST_CASE("materials: equal lobes have equal keys regardless of colour") {
  const auto key = [](const BsdfPtr& bsdf) { return bsdf->lobes()[0]->key(); };
  const BsdfPtr a = bsdfOf("roughplastic", {{"alpha", 0.1}, {"int_ior", 1.5}, {"ext_ior", 1.0}});
  const BsdfPtr b = bsdfOf("roughplastic", {{"alpha", 0.1},
                                            {"int_ior", 1.5},
                                            {"ext_ior", 1.0},
                                            {"nonlinear", true},
                                            {"diffuse_reflectance", Rgb(1.0f, 0.0f, 0.0f)}});
  CHECK(key(a) == key(b));
  CHECK(key(a) != key(bsdfOf("roughplastic", {{"alpha", 0.11}, {"int_ior", 1.5}, {"ext_ior", 1.0}})));
  CHECK(key(a) != key(bsdfOf("roughplastic", {{"alpha", 0.1}, {"int_ior", 1.6}, {"ext_ior", 1.0}})));
  CHECK(key(a) !=
        key(bsdfOf("roughplastic",
                   {{"alpha", 0.1}, {"int_ior", 1.5}, {"ext_ior", 1.0}, {"distribution", std::string("ggx")}})));
  const Rgb eta(1.0f, 2.0f, 3.0f);
  const BsdfPtr c = bsdfOf("roughconductor", {{"eta", eta}, {"k", eta}, {"ext_eta", 1.0}});
  const BsdfPtr d =
      bsdfOf("roughconductor",
             {{"eta", Rgb(2 * eta)}, {"k", Rgb(2 * eta)}, {"ext_eta", 2.0}, {"specular_reflectance", grey(0.3f)}});
  CHECK(key(c) == key(d));
  CHECK(c->lobes()[0]->kind() == LobeKind::isotropic);
  CHECK(bsdfOf("roughconductor", {{"alpha_u", 0.1}, {"alpha_v", 0.2}})->lobes()[0]->kind() == LobeKind::anisotropic);
  CHECK(c->lobes()[0]->model() == "beckmann-conductor");
  CHECK(a->lobes()[0]->summary() == "beckmann α 0.1, dielectric 1.5");
}

TEST_CASE("materials: the value of a lobe is the luminance of its material") {
  const BsdfPtr copper = bsdfOf("roughconductor", {{"alpha", 0.3}});
  const Vec3 wo = directionAt(40.0, 10.0);
  const Vec3 wi = directionAt(50.0, 170.0);
  CHECK(copper->lobes()[0]->eval(wo, wi) == Approx(luminance(copper->eval(wo, wi, kUv))).epsilon(1e-5));
  CHECK(copper->eval(wo, wi, kUv).x() > copper->eval(wo, wi, kUv).z());
}

TEST_CASE("materials: rough plastic of negligible roughness has the diffuse part of smooth plastic") {
  const BsdfPtr smooth = bsdfOf("plastic", {{"diffuse_reflectance", Rgb(0.2f, 0.5f, 0.8f)}});
  const BsdfPtr rough = bsdfOf("roughplastic", {{"diffuse_reflectance", Rgb(0.2f, 0.5f, 0.8f)}, {"alpha", 0.001}});
  const Vec3 wo = directionAt(30.0);
  const Vec3 wi = directionAt(70.0, 90.0);
  const Rgb a = smooth->eval(wo, wi, kUv);
  const Rgb b = rough->eval(wo, wi, kUv);
  CHECK(((a - b).abs() / a).maxCoeff() < 0.005f);
}

TEST_CASE("materials: one-sided models are black from behind and twosided has one model per side") {
  const Vec3 above = directionAt(30.0);
  const Vec3 below = directionAt(150.0);
  for (const char* type : {"diffuse", "plastic", "roughplastic", "roughconductor", "conductor"}) {
    const BsdfPtr bsdf = bsdfOf(type);
    INFO(type);
    CHECK(bsdf->eval(below, below, kUv).maxCoeff() == 0.0f);
    CHECK(bsdf->eval(above, below, kUv).maxCoeff() == 0.0f);
    CHECK(bsdf->pdf(below, below, kUv) == 0.0f);
    CHECK_FALSE(bsdf->sample(below, kUv, 0.5f, Vec2(0.5f, 0.5f)));
    CHECK_FALSE(bsdf->sampleDelta(below, kUv, 0.5f));
    CHECK(bsdf->mixture(below, kUv).glossyCount == 0);
    CHECK(bsdf->mixture(below, kUv).constant == 0.0f);
    CHECK(bsdf->albedo(below, kUv).maxCoeff() == 0.0f);
  }
  const BsdfPtr front = bsdfOf("roughconductor", {{"specular_reflectance", grey(0.5f)}});
  const BsdfPtr back = bsdfOf("roughplastic", {{"specular_reflectance", grey(0.25f)}});
  const BsdfPtr both = bsdfOf("twosided", {}, {front, back});
  REQUIRE(both->lobes().size() == 2);
  CHECK(both->mixture(above, kUv).glossy[0].lobe == 0);
  CHECK(both->mixture(above, kUv).glossy[0].tint == Approx(0.5f));
  CHECK(both->mixture(below, kUv).glossy[0].lobe == 1);
  CHECK(both->mixture(below, kUv).glossy[0].tint == Approx(0.25f));
  CHECK(both->eval(below, below, kUv).isApprox(back->eval(above, above, kUv)));
  CHECK(bsdfOf("twosided", {}, {front})->lobes().size() == 1);
  const auto mirrored = bsdfOf("twosided", {}, {bsdfOf("conductor")})->sampleDelta(below, kUv, 0.5f);
  REQUIRE(mirrored);
  CHECK(mirrored->wi.isApprox(Vec3(-below.x(), -below.y(), below.z())));
}

TEST_CASE("materials: bump mapping gives the normals of the displaced surface") {
  const BsdfPtr bump = bsdfOf("bumpmap", {{"", std::make_shared<Waves>()}, {"scale", 2.0}}, {bsdfOf("diffuse")});
  const Vec3 dpdu(2.0f, 0.3f, 0.0f);
  for (const float flip : {1.0f, -1.0f}) {
    const Vec3 dpdv(-0.1f, 1.5f * flip, 0.0f);
    for (const Vec2& uv : {Vec2(0.1f, 0.2f), Vec2(-3.4f, 5.5f), Vec2(0.7f, 0.9f)}) {
      const Vec3 du = dpdu + Vec3::UnitZ() * 2.0f * 0.2f * std::cos(4.0f * uv.x());
      const Vec3 dv = dpdv - Vec3::UnitZ() * 2.0f * 0.09f * std::sin(3.0f * uv.y());
      const Vec3 expected = flip * du.cross(dv).normalized();
      const Vec3 n = bump->perturbedNormal(Vec3::UnitZ(), uv, dpdu, dpdv);
      CHECK((n - expected).norm() < 2e-3f);
      CHECK(n.norm() == Approx(1.0f).margin(1e-5));
      CHECK(n.z() > 0.0f);
    }
  }
  // The normals do not change when surface and bumps are scaled together.
  for (const double size : {1e-12, 1e10}) {
    const BsdfPtr sized =
        bsdfOf("bumpmap", {{"", std::make_shared<Waves>()}, {"scale", 2.0 * size}}, {bsdfOf("diffuse")});
    const Vec3 u = dpdu * static_cast<float>(size), v = Vec3(-0.1f, 1.5f, 0.0f) * static_cast<float>(size);
    const Vec3 expected = bump->perturbedNormal(Vec3::UnitZ(), kUv, dpdu, Vec3(-0.1f, 1.5f, 0.0f));
    CHECK((sized->perturbedNormal(Vec3::UnitZ(), kUv, u, v) - expected).norm() < 1e-4f);
    CHECK((expected - Vec3::UnitZ()).norm() > 0.05f);
  }
  const BsdfPtr flat = bsdfOf("bumpmap", {{"map", constantTexture(grey(0.4f))}}, {bsdfOf("diffuse")});
  CHECK(flat->perturbedNormal(Vec3::UnitZ(), kUv, dpdu, Vec3::UnitY()).isApprox(Vec3::UnitZ()));
  CHECK(flat->perturbedNormal(Vec3::UnitZ(), kUv, Vec3::Zero(), Vec3::Zero()) == Vec3::UnitZ());
  CHECK(bsdfOf("diffuse")->perturbedNormal(Vec3::UnitZ(), kUv, dpdu, Vec3::UnitY()) == Vec3::UnitZ());
  // A mask passes on the normals of its nested bump map.
  const BsdfPtr masked = bsdfOf("mask", {}, {bump});
  CHECK(masked->perturbedNormal(Vec3::UnitZ(), kUv, dpdu, Vec3::UnitY()) ==
        bump->perturbedNormal(Vec3::UnitZ(), kUv, dpdu, Vec3::UnitY()));
}

}  // namespace lobe
