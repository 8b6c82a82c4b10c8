// χ² tests of all samplers of materials/, and of wrong densities, which the χ² test must reject.

#include <catch2/catch.hpp>

#include "runtime/core/sampling.h"
#include "tests/support/chi2.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

struct View {
  double elevation, azimuth;
};
constexpr View kViews[] = {{0.0, 0.0}, {40.0, 200.0}, {80.0, 30.0}, {89.9, 110.0}};

struct Roughness {
  double u, v;
};
constexpr Roughness kRoughness[] = {{0.005, 0.005}, {0.05, 0.05}, {0.3, 0.3}, {1.0, 1.0}, {0.03, 0.3}, {0.6, 0.005}};

BsdfPtr roughConductor(const std::string& distribution, const Roughness& alpha) {
  return bsdfOf("roughconductor", {{"distribution", distribution}, {"alpha_u", alpha.u}, {"alpha_v", alpha.v}});
}

Chi2Result testLobe(const Lobe& lobe, const Vec3& wo, std::uint64_t seed, double densityScale = 1.0) {
  Rng rng(seed);
  const auto sampler = [&]() -> std::optional<Vec3> {
    const std::optional<LobeSample> s = lobe.sample(wo, rng.uniform2());
    return s ? std::optional<Vec3>(s->wi) : std::nullopt;
  };
  return chi2Sphere(sampler, [&](const Vec3& wi) { return densityScale * lobe.pdf(wo, wi); });
}

Chi2Result testBsdf(const Bsdf& bsdf, const Vec3& wo, std::uint64_t seed) {
  Rng rng(seed);
  const auto sampler = [&]() -> std::optional<Vec3> {
    const float choice = rng.uniform();
    const std::optional<BsdfSample> s = bsdf.sample(wo, kUv, choice, rng.uniform2());
    return s ? std::optional<Vec3>(s->wi) : std::nullopt;
  };
  return chi2Sphere(sampler, [&](const Vec3& wi) { return bsdf.pdf(wo, wi, kUv); });
}

}  // namespace

TEST_CASE("materials: the chi-square test accepts correct samplers of the square and the sphere") {
  Rng rng(1);
  const auto square = [&]() -> std::optional<Eigen::Vector2d> {
    const Vec2 u = rng.uniform2();
    return Eigen::Vector2d(std::sqrt(u.x()), u.y());
  };
  const Chi2Result flat = chi2Square(square, [](const Eigen::Vector2d& p) { return 2.0 * p.x(); });
  INFO(flat.message);
  CHECK(flat.passed());
  const auto sphere = [&]() -> std::optional<Vec3> { return squareToSphere(rng.uniform2()); };
  const Chi2Result round = chi2Sphere(sphere, [](const Vec3&) { return 0.25 * kInvPi; });
  INFO(round.message);
  CHECK(round.passed());
}

TEST_CASE("materials: the chi-square test rejects wrong densities") {
  Rng rng(2);
  const auto sampler = [&]() -> std::optional<Vec3> { return squareToCosineHemisphere(rng.uniform2()); };
  const auto judge = [&](auto density) { return chi2Sphere(sampler, density); };
  CHECK(judge([](const Vec3& w) { return cosineHemispherePdf(w); }).passed());
  CHECK_FALSE(judge([](const Vec3& w) { return 0.98f * cosineHemispherePdf(w); }).passed(1000));
  CHECK_FALSE(judge([](const Vec3& w) { return 1.02f * cosineHemispherePdf(w); }).passed(1000));
  CHECK_FALSE(judge([](const Vec3& w) { return w.z() > 0.0f ? 0.5f * kInvPi : 0.0f; }).passed(1000));
  CHECK_FALSE(
      judge([](const Vec3& w) { return 0.5f * (cosineHemispherePdf(w) + cosineHemispherePdf(-w)); }).passed(1000));
  CHECK_FALSE(judge([](const Vec3& w) { return cosineHemispherePdf(w) * (1.0f + 0.1f * w.x()); }).passed(1000));
}

TEST_CASE("materials: the chi-square test rejects the density of a lobe with slightly different roughness") {
  for (const char* distribution : {"ggx", "beckmann"}) {
    const BsdfPtr drawn = roughConductor(distribution, {0.1, 0.1});
    const BsdfPtr claimed = roughConductor(distribution, {0.11, 0.11});
    for (const View& view : kViews) {
      const Vec3 wo = directionAt(view.elevation, view.azimuth);
      Rng rng(3);
      const auto sampler = [&]() -> std::optional<Vec3> {
        const std::optional<LobeSample> s = drawn->lobes()[0]->sample(wo, rng.uniform2());
        return s ? std::optional<Vec3>(s->wi) : std::nullopt;
      };
      CHECK_FALSE(chi2Sphere(sampler, [&](const Vec3& w) { return claimed->lobes()[0]->pdf(wo, w); }).passed(1000));
      CHECK_FALSE(testLobe(*drawn->lobes()[0], wo, 4, 0.95).passed(1000));
    }
  }
}

TEST_CASE("materials: samples of rough lobes match their density", "[slow]") {
  constexpr int kTests = 2 * static_cast<int>(std::size(kRoughness) * std::size(kViews));
  std::uint64_t seed = 100;
  for (const std::string distribution : {"ggx", "beckmann"})
    for (const Roughness& alpha : kRoughness) {
      const LobePtr lobe = roughConductor(distribution, alpha)->lobes()[0];
      for (const View& view : kViews) {
        const Chi2Result r = testLobe(*lobe, directionAt(view.elevation, view.azimuth), ++seed);
        INFO(lobe->summary() << " seen at " << view.elevation << " degrees: " << r.message);
        CHECK(r.passed(kTests));
      }
    }
}

TEST_CASE("materials: samples of narrow lobes match their density for alpha 0.001 up to 89.99 degrees", "[slow]") {
  std::uint64_t seed = 200;
  for (const std::string distribution : {"ggx", "beckmann"})
    for (const double elevation : {0.01, 60.0, 89.0, 89.99}) {
      const LobePtr lobe = roughConductor(distribution, {0.001, 0.001})->lobes()[0];
      const Chi2Result r = testLobe(*lobe, directionAt(elevation, 75.0), ++seed);
      INFO(lobe->summary() << " seen at " << elevation << " degrees: " << r.message);
      CHECK(r.passed(8));
    }
}

TEST_CASE("materials: samples of every model match its density", "[heavy]") {
  const BsdfPtr diffuse = bsdfOf("diffuse");
  const BsdfPtr plastic = bsdfOf("plastic");
  const BsdfPtr shiny = bsdfOf("roughplastic", {{"alpha", 0.05}, {"distribution", std::string("ggx")}});
  const BsdfPtr dull = bsdfOf("roughplastic", {{"alpha", 0.4}});
  const BsdfPtr metal = bsdfOf("roughconductor", {{"alpha_u", 0.4}, {"alpha_v", 0.1}});
  const std::pair<const char*, BsdfPtr> models[] = {
      {"diffuse", diffuse},
      {"plastic", plastic},
      {"shiny roughplastic", shiny},
      {"dull roughplastic", dull},
      {"roughconductor", metal},
      {"twosided", bsdfOf("twosided", {}, {shiny, metal})},
      {"mask", bsdfOf("mask", {{"opacity", Rgb(0.2f, 0.5f, 0.9f)}}, {bsdfOf("twosided", {}, {dull})})},
      {"difftrans", bsdfOf("difftrans")},
      {"blendbsdf", bsdfOf("blendbsdf", {{"weight", 0.3}}, {bsdfOf("twosided", {}, {shiny, plastic}), plastic})},
      {"mixturebsdf", bsdfOf("mixturebsdf", {{"weights", std::string("0.2 0.3 0.4")}},
                             {metal, bsdfOf("difftrans"), bsdfOf("dielectric")})},
      {"roughdiffuse", bsdfOf("roughdiffuse", {{"alpha", 0.7}})},
      {"dull phong", bsdfOf("phong", {{"exponent", 3.0}})},
      {"shiny phong", bsdfOf("phong", {{"exponent", 3000.0}, {"diffuse_reflectance", 0.05}})},
      {"ward", bsdfOf("ward", {{"alpha_u", 0.3}, {"variant", std::string("ward")}})},
      {"ward-duer", bsdfOf("ward", {{"alpha_v", 0.5}, {"variant", std::string("ward-duer")}})},
      {"balanced ward", bsdfOf("ward", {{"alpha_u", 0.02}, {"alpha_v", 0.3}})},
      {"principled", bsdfOf("principled", {{"roughness", 0.4}, {"clearcoat", 1.0}, {"sheen", 1.0}})},
      {"principled metal", bsdfOf("principled", {{"roughness", 0.5}, {"anisotropic", 0.8}, {"metallic", 1.0}})},
      {"principled glass", bsdfOf("principled", {{"roughness", 0.5}, {"spec_trans", 1.0}, {"eta", 1.5}})},
      {"all of principled", bsdfOf("principled", {{"roughness", 0.6},
                                                  {"anisotropic", 0.5},
                                                  {"metallic", 0.3},
                                                  {"spec_trans", 0.6},
                                                  {"clearcoat", 0.7},
                                                  {"clearcoat_sampling_rate", 4.0},
                                                  {"specular", 0.8}})},
      {"coated diffuse", bsdfOf("coating", {{"sigma_a", 0.3}}, {diffuse})},
      {"coated metal", bsdfOf("coating", {{"int_ior", 1.8}}, {metal})},
      {"coated on both sides", bsdfOf("coating", {}, {bsdfOf("twosided", {}, {dull})})},
      {"roughly coated metal", bsdfOf("roughcoating", {{"alpha", 0.2}}, {metal})},
      {"roughly coated plastic", bsdfOf("roughcoating", {{"alpha", 0.05}}, {bsdfOf("twosided", {}, {plastic})})},
      {"principledthin", bsdfOf("principledthin", {{"roughness", 0.5},
                                                   {"anisotropic", 0.5},
                                                   {"spec_trans", 0.6},
                                                   {"diff_trans", 0.8},
                                                   {"diffuse_transmittance_sampling_rate", 2.0}})},
      {"rough principledthin", bsdfOf("principledthin", {{"roughness", 1.0}, {"spec_trans", 1.0}, {"eta", 1.3}})},
      {"heavy mixture", bsdfOf("mixturebsdf", {{"weights", std::string("2 1")}, {"ensure_energy_conservation", false}},
                               {bsdfOf("diffuse", {{"reflectance", 0.2}}), dull})},
      {"bumpmap", bsdfOf("bumpmap", {{"map", constantTexture(grey(1.0f))}}, {metal})},
  };
  std::uint64_t seed = 300;
  for (const auto& [name, bsdf] : models)
    for (const View& view : {kViews[1], kViews[3]})
      for (const double side : {1.0, -1.0}) {
        Vec3 wo = directionAt(view.elevation, view.azimuth);
        wo.z() *= static_cast<float>(side);
        if (side < 0.0 && bsdf->pdf(wo, -Vec3::UnitZ(), kUv) + bsdf->pdf(wo, Vec3::UnitZ(), kUv) == 0.0f) continue;
        const Chi2Result r = testBsdf(*bsdf, wo, ++seed);
        INFO(name << " seen at " << view.elevation << " degrees, side " << side << ": " << r.message);
        CHECK(r.passed(100));
      }
}

}  // namespace lobe
