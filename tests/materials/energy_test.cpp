// Tests of every model: reciprocity, energy conservation, white furnaces, samples that agree with eval and pdf.

#include <catch2/catch.hpp>

#include "materials/lobes/fresnel.h"
#include "materials/lobes/microfacet.h"
#include "materials/lobes/rough_transmittance.h"
#include "materials/textures/checkerboard.h"
#include "runtime/core/sampling.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

struct Named {
  std::string name;
  BsdfPtr bsdf;
  double mostAlbedo = 1.0;  ///< above 1 for models that are known to create energy at grazing angles
};

/// The principled interface reflects everything at grazing angles, but the diffuse part is not reduced accordingly.
constexpr double kPrincipledAlbedo = 1.1;

/// All models with a smooth part, with several values of roughness.
std::vector<Named> smoothModels() {
  std::vector<Named> models = {
      {"diffuse", bsdfOf("diffuse", {{"reflectance", Rgb(0.9f, 0.5f, 0.1f)}})},
      {"plastic", bsdfOf("plastic", {{"diffuse_reflectance", grey(0.95f)}})},
      {"nonlinear plastic", bsdfOf("plastic", {{"diffuse_reflectance", grey(0.95f)}, {"nonlinear", true}})},
  };
  for (const std::string distribution : {"ggx", "beckmann"})
    for (const double alpha : {0.001, 0.02, 0.3, 1.0}) {
      const std::string suffix = " " + distribution + " " + std::to_string(alpha);
      models.push_back({"roughconductor" + suffix, bsdfOf("roughconductor", {{"distribution", distribution},
                                                                             {"alpha_u", alpha},
                                                                             {"alpha_v", std::min(1.0, 3.0 * alpha)},
                                                                             {"material", std::string("Ag")}})});
      models.push_back({"roughplastic" + suffix, bsdfOf("roughplastic", {{"distribution", distribution},
                                                                         {"alpha", alpha},
                                                                         {"nonlinear", alpha < 0.1},
                                                                         {"diffuse_reflectance", grey(0.9f)}})});
    }
  for (const std::string distribution : {"ggx", "beckmann"})
    for (const double alpha : {0.001, 0.1, 0.7})
      models.push_back({"roughdielectric " + distribution + " " + std::to_string(alpha),
                        bsdfOf("roughdielectric", {{"distribution", distribution},
                                                   {"alpha_u", alpha},
                                                   {"alpha_v", 1.4 * alpha},
                                                   {"specular_transmittance", Rgb(0.3f, 0.9f, 0.6f)}})});
  const TexturePtr varying = makeCheckerboard(constantTexture(grey(0.13f)), constantTexture(grey(0.6f)));
  for (const char* type : {"roughconductor", "roughplastic", "roughdielectric"})
    models.push_back({std::string("textured ") + type, bsdfOf(type, {{"alpha", varying}})});
  const BsdfPtr front = models[3].bsdf;
  const BsdfPtr back = models[4].bsdf;
  models.push_back({"twosided", bsdfOf("twosided", {}, {front, back})});
  models.push_back({"mask", bsdfOf("mask", {{"opacity", Rgb(0.3f, 0.6f, 0.9f)}}, {models.back().bsdf})});
  for (const double exponent : {0.0, 5.0, 200.0, 20000.0})
    models.push_back(
        {"phong " + std::to_string(exponent),
         bsdfOf("phong", {{"exponent", exponent}, {"specular_reflectance", 0.6}, {"diffuse_reflectance", 0.4}})});
  for (const double alpha : {0.003, 0.1, 0.5})
    models.push_back({"balanced ward " + std::to_string(alpha), bsdfOf("ward", {{"alpha_u", alpha},
                                                                                {"alpha_v", 2.0 * alpha},
                                                                                {"specular_reflectance", 0.6},
                                                                                {"diffuse_reflectance", 0.4}})});
  for (const bool fast : {false, true})
    for (const double alpha : {0.1, 0.5, 1.0})
      models.push_back({"roughdiffuse " + std::to_string(alpha) + (fast ? " fast" : ""),
                        bsdfOf("roughdiffuse", {{"alpha", alpha}, {"reflectance", 0.9}, {"use_fast_approx", fast}})});
  for (const double roughness : {0.1, 0.5, 1.0}) {
    const std::string suffix = std::to_string(roughness);
    models.push_back({"principled " + suffix,
                      bsdfOf("principled", {{"roughness", roughness}, {"base_color", Rgb(0.8f, 0.5f, 0.2f)}}),
                      kPrincipledAlbedo});
    models.push_back({"principled metal " + suffix, bsdfOf("principled", {{"roughness", roughness},
                                                                          {"base_color", Rgb(1.0f, 0.8f, 0.6f)},
                                                                          {"metallic", 1.0},
                                                                          {"anisotropic", 0.5}})});
    models.push_back({"flat and coated principled " + suffix,
                      bsdfOf("principled", {{"roughness", roughness},
                                            {"metallic", 0.2},
                                            {"flatness", 0.7},
                                            {"spec_tint", 0.8},
                                            {"sheen", 0.3},
                                            {"sheen_tint", 0.5},
                                            {"clearcoat", 1.0},
                                            {"clearcoat_gloss", 0.5}}),
                      kPrincipledAlbedo});
  }
  models.push_back({"blendbsdf", bsdfOf("blendbsdf", {{"weight", 0.4}}, {models[1].bsdf, back})});
  models.push_back({"mixturebsdf", bsdfOf("mixturebsdf", {{"weights", std::string("0.5 0.2 0.3")}},
                                          {front, models[0].bsdf, models[1].bsdf})});
  const BsdfPtr bright = bsdfOf("diffuse", {{"reflectance", 0.9}});
  for (const double alpha : {0.02, 0.3})
    models.push_back({"coated " + std::to_string(alpha),
                      bsdfOf("roughcoating", {{"alpha", alpha}, {"distribution", std::string("ggx")}}, {bright})});
  models.push_back(
      {"dyed coating", bsdfOf("coating", {{"sigma_a", Rgb(0.1f, 0.5f, 1.0f)}, {"thickness", 0.4}}, {bright})});
  models.push_back({"coated on both sides", bsdfOf("coating", {{"int_ior", 1.8}}, {bsdfOf("twosided", {}, {bright})})});
  models.push_back({"coated plastic", bsdfOf("coating", {}, {bsdfOf("plastic")})});
  for (const double roughness : {0.1, 0.6})
    models.push_back({"principledthin " + std::to_string(roughness),
                      bsdfOf("principledthin", {{"roughness", roughness},
                                                {"base_color", Rgb(0.9f, 0.5f, 0.2f)},
                                                {"spec_trans", 0.6},
                                                {"spec_tint", 0.3},
                                                {"diff_trans", 0.7},
                                                {"sheen", 0.2}}),
                      kPrincipledAlbedo});
  return models;
}

constexpr double kElevations[] = {0.0, 30.0, 60.0, 85.0, 89.9, 89.99};

}  // namespace

TEST_CASE("materials: reflection is reciprocal") {
  Rng rng(11);
  for (const Named& model : smoothModels()) {
    INFO(model.name);
    double worst = 0.0;
    for (int i = 0; i < 2000; ++i) {
      const Vec3 wo = squareToCosineHemisphere(rng.uniform2());
      // Half of the pairs are near mirror directions, where narrow lobes are large.
      Vec3 wi = squareToCosineHemisphere(rng.uniform2());
      if (i % 2) wi = (Vec3(-wo.x(), -wo.y(), wo.z()) + 0.002f * wi).normalized();
      const Rgb a = model.bsdf->eval(wo, wi, kUv);
      const Rgb b = model.bsdf->eval(wi, wo, kUv);
      worst = std::max<double>(worst, ((a - b).abs() / (a + b).max(1e-6f)).maxCoeff());
    }
    CHECK(worst < 1e-4);
  }
}

TEST_CASE("materials: samples have the value and density of their direction and a bounded weight") {
  Rng rng(12);
  for (const Named& model : smoothModels())
    for (const double elevation : kElevations) {
      INFO(model.name << " seen at " << elevation);
      const Vec3 wo = directionAt(elevation, 70.0);
      int bad = 0;
      float largest = 0.0f;
      for (int i = 0; i < 2000; ++i) {
        const float choice = rng.uniform();
        const auto s = model.bsdf->sample(wo, kUv, choice, rng.uniform2());
        if (!s) continue;
        const Rgb weight = s->f * std::abs(s->wi.z()) / s->pdf;
        // Up to rounding, which depends on what the compiler has inlined.
        constexpr float kRounding = 1e-5f;
        const Rgb f = model.bsdf->eval(wo, s->wi, kUv);
        const float pdf = model.bsdf->pdf(wo, s->wi, kUv);
        const bool right = ((s->f - f).abs() <= kRounding * f).all() && std::abs(s->pdf - pdf) <= kRounding * pdf &&
                           s->pdf > 0.0f && std::isfinite(s->pdf) && s->f.allFinite() && (s->f >= 0.0f).all() &&
                           weight.allFinite() && std::abs(s->wi.norm() - 1.0f) < 1e-5f;
        bad += !right;
        largest = std::max(largest, weight.maxCoeff());
      }
      CHECK(bad == 0);
      CHECK(largest < 4.0f);
    }
}

TEST_CASE("materials: eval and pdf are finite and not negative for all directions") {
  Rng rng(13);
  const float edge[] = {0.0f, -0.0f, 1e-38f, 1e-12f, 1e-6f, -1e-6f, 1.0f, -1.0f};
  for (const Named& model : smoothModels()) {
    INFO(model.name);
    int bad = 0;
    for (int i = 0; i < 3000; ++i) {
      Vec3 wo = squareToSphere(rng.uniform2());
      Vec3 wi = i % 3 ? squareToSphere(rng.uniform2()) : Vec3(-wo.x(), -wo.y(), wo.z());
      if (i % 2) wo.z() = edge[rng.next() % 8], wo.normalize();
      if (i % 4 > 1) wi.z() = edge[rng.next() % 8], wi.normalize();
      const Rgb f = model.bsdf->eval(wo, wi, kUv);
      const float p = model.bsdf->pdf(wo, wi, kUv);
      bad += !(f.allFinite() && (f >= 0.0f).all() && std::isfinite(p) && p >= 0.0f);
      const auto s = model.bsdf->sample(wo, kUv, rng.uniform(), rng.uniform2());
      bad += s && !(s->f.allFinite() && s->wi.allFinite() && std::isfinite(s->pdf) && s->pdf > 0.0f);
      const float delta = model.bsdf->deltaProbability(wo, kUv);
      bad += !(delta >= 0.0f && delta <= 1.0f);
    }
    CHECK(bad == 0);
  }
}

TEST_CASE("materials: no model creates energy and mixture and albedo are accurate") {
  for (const Named& model : smoothModels())
    for (const double elevation : kElevations) {
      INFO(model.name << " seen at " << elevation);
      const Vec3 wo = directionAt(elevation, 20.0);
      Rng rng(14);
      Mean smooth, reflected, total;
      for (int i = 0; i < 8000; ++i) {
        const float choice = rng.uniform();
        const float delta = model.bsdf->deltaProbability(wo, kUv);
        const auto s = model.bsdf->sample(wo, kUv, choice, rng.uniform2());
        const double value = s ? luminance(s->f) * std::abs(s->wi.z()) / s->pdf : 0.0;
        smooth.add(value);
        reflected.add(s && s->wi.z() > 0.0f ? value : 0.0);
        if (rng.uniform() < delta) {
          const auto d = model.bsdf->sampleDelta(wo, kUv, rng.uniform());
          total.add(d ? luminance(d->weight) / delta : 0.0);
        } else {
          total.add(value / (1.0 - delta));
        }
      }
      CHECK(smooth.value() <= model.mostAlbedo + 4.0 * smooth.error() + 1e-4);
      CHECK(total.value() <= model.mostAlbedo + 4.0 * total.error() + 1e-4);
      // The albedo of the mixture: the sum over its lobes and the constant.
      const LobeMixture mixture = model.bsdf->mixture(wo, kUv);
      double modelled = mixture.constant;
      for (int i = 0; i < mixture.glossyCount; ++i) {
        const LobeTint& tint = mixture.glossy[static_cast<std::size_t>(i)];
        const Lobe& lobe = *model.bsdf->lobes()[static_cast<std::size_t>(tint.lobe)];
        Mean albedo;
        for (int n = 0; n < 8000; ++n) {
          const auto s = lobe.sample(wo, rng.uniform2());
          albedo.add(s ? lobe.eval(wo, s->wi) * s->wi.z() / s->pdf : 0.0);
        }
        modelled += tint.tint * albedo.value();
      }
      CHECK(modelled == Approx(reflected.value()).margin(5.0 * reflected.error() + 0.01));
      CHECK(luminance(model.bsdf->albedo(wo, kUv)) <= 1.0f + 1e-5f);
    }
}

TEST_CASE("materials: the mixture of rough plastic approximates its value near the mirror direction") {
  const BsdfPtr bsdf = bsdfOf("roughplastic", {{"alpha", 0.2}, {"specular_reflectance", grey(0.7f)}});
  const Vec3 wo = directionAt(50.0);
  const LobeMixture mixture = bsdf->mixture(wo, kUv);
  REQUIRE(mixture.glossyCount == 1);
  CHECK(mixture.glossy[0].tint == Approx(0.7f));
  // Near the mirror direction the lobe dominates; the constant is an average over wi.
  const Vec3 wi = directionAt(50.0, 180.0);
  const double modelled = mixture.glossy[0].tint * bsdf->lobes()[0]->eval(wo, wi) + mixture.constant * kInvPi;
  CHECK(modelled == Approx(luminance(bsdf->eval(wo, wi, kUv))).epsilon(0.02));
}

TEST_CASE("materials: distributions of normals pass the weak white furnace test") {
  // ∫ G1(wo) D(h) / (4 cosθo) dwi = 1 over the whole sphere, where wi is wo reflected at h.
  for (const auto kind : {Microfacet::Kind::beckmann, Microfacet::Kind::ggx})
    for (const double alpha : {0.05, 0.4, 1.0})
      for (const double elevation : {0.0, 50.0, 85.0, 89.0}) {
        const Microfacet m(kind, alpha, std::min(1.0, 2.0 * alpha));
        const Eigen::Vector3d wo = directionAt(elevation, 25.0).cast<double>().normalized();
        // Integrated over normals: dwi = 4 (wo·h) dh. Midpoint rule over the slope tan θ of h.
        double sum = 0.0;
        constexpr int kSteps = 700;
        for (int i = 0; i < kSteps; ++i)
          for (int j = 0; j < kSteps; ++j) {
            const double s = (i + 0.5) / kSteps;
            const double r = s / (1.0 - s);  // |slope| over alpha
            const double phi = 2.0 * std::numbers::pi * (j + 0.5) / kSteps;
            const double x = m.alphaU() * r * std::cos(phi);
            const double y = m.alphaV() * r * std::sin(phi);
            const Eigen::Vector3d h = Eigen::Vector3d(-x, -y, 1.0).normalized();
            const double dh = m.alphaU() * m.alphaV() * r / ((1.0 - s) * (1.0 - s)) * std::pow(h.z(), 3);
            sum += m.density(h) * std::max(0.0, wo.dot(h)) * dh;
          }
        const double integral = sum * 2.0 * std::numbers::pi / (kSteps * kSteps) * m.shadowingOverCosine(wo);
        INFO(m.name() << " " << alpha << " at " << elevation);
        CHECK(integral == Approx(1.0).margin(2e-4));
      }
}

TEST_CASE("materials: a perfect conductor loses energy only by shadowing") {
  for (const std::string distribution : {"ggx", "beckmann"})
    for (const double alpha : {0.01, 0.2}) {
      const BsdfPtr mirror = bsdfOf(
          "roughconductor", {{"distribution", distribution}, {"alpha", alpha}, {"material", std::string("none")}});
      Rng rng(15);
      Mean albedo;
      for (int i = 0; i < 20000; ++i) {
        const auto s = mirror->sample(directionAt(30.0), kUv, 0.0f, rng.uniform2());
        albedo.add(s ? luminance(s->f) * s->wi.z() / s->pdf : 0.0);
      }
      INFO(distribution << " " << alpha);
      CHECK(albedo.value() <= 1.0 + 1e-6);
      CHECK(albedo.value() > (alpha < 0.1 ? 0.999 : 0.92));
    }
}

TEST_CASE("materials: rough transmittance converges to the smooth one and matches sampled normals") {
  for (const double eta : {1.3, 1.5, 2.4}) {
    const RoughTransmittance t(Microfacet(Microfacet::Kind::ggx, 0.001, 0.001), eta);
    for (const float c : {0.05f, 0.3f, 0.7f, 1.0f})
      CHECK(t(c) == Approx(1.0 - fresnelDielectric(c, eta).reflectance).margin(3e-3));
    CHECK(t.mean() == Approx(1.0 - fresnelDiffuse(eta)).margin(2e-3));
    CHECK(t.internalReflectance() == Approx(fresnelDiffuse(1.0 / eta)).margin(2e-3));
  }
  // Compared with the mean over random normals.
  const Microfacet m(Microfacet::Kind::beckmann, 0.3, 0.3);
  const RoughTransmittance t(m, 1.5);
  Rng rng(16);
  const Eigen::Vector3d wo = directionAt(70.0).cast<double>().normalized();
  Mean mean;
  for (int i = 0; i < 200000; ++i) {
    const Eigen::Vector3d h = m.sampleVisible(wo, rng.uniform2());
    const DielectricFresnel f = fresnelDielectric(wo.dot(h), 1.5);
    const Eigen::Vector3d wt = (wo.dot(h) / 1.5 - f.cosTransmitted) * h - wo / 1.5;
    const Eigen::Vector3d up(wt.x(), wt.y(), -wt.z());
    mean.add(wt.z() < 0.0 ? (1.0 - f.reflectance) * m.shadowingOverCosine(up) * up.z() : 0.0);
  }
  CHECK(t(static_cast<float>(wo.z())) == Approx(mean.value()).margin(4.0 * mean.error() + 2e-3));
}

TEST_CASE("materials: equal interfaces share their transmittance table while it is used") {
  const Microfacet m(Microfacet::Kind::ggx, 0.21, 0.21), other(Microfacet::Kind::beckmann, 0.21, 0.21);
  const auto table = RoughTransmittance::shared(m, 1.5);
  CHECK(table == RoughTransmittance::shared(m, 1.5));
  CHECK(table != RoughTransmittance::shared(m, 1.4));
  CHECK(table != RoughTransmittance::shared(other, 1.5));
  CHECK((*table)(0.5f) == RoughTransmittance(m, 1.5)(0.5f));
}

TEST_CASE("materials: a dielectric conserves energy and refracts by Snell's law") {
  const BsdfPtr glass = bsdfOf("dielectric", {{"int_ior", 1.5}, {"ext_ior", 1.0}});
  for (const double elevation : {0.0, 30.0, 60.0, 89.0, 120.0, 135.0, 179.0}) {
    const Vec3 wo = directionAt(elevation, 40.0);
    double energy = 0.0;
    constexpr int kChoices = 4096;
    bool reflected = false;
    for (int i = 0; i < kChoices; ++i) {
      const auto s = glass->sampleDelta(wo, kUv, (static_cast<float>(i) + 0.5f) / kChoices);
      REQUIRE(s);
      energy += s->weight.x() * s->eta * s->eta / kChoices;
      if (s->wi.z() * wo.z() > 0.0f) {
        reflected = true;
        CHECK(s->eta == 1.0f);
      } else {
        CHECK(s->eta == Approx(wo.z() > 0.0f ? 1.5 : 1.0 / 1.5));
        CHECK(s->wi.head<2>().norm() * s->eta == Approx(wo.head<2>().norm()).margin(1e-6));
        CHECK(s->wi.norm() == Approx(1.0).margin(1e-6));
        CHECK(s->weight.x() == Approx(1.0 / (s->eta * s->eta)).margin(1e-5));
      }
    }
    INFO(elevation);
    CHECK(reflected);
    CHECK(energy == Approx(1.0).margin(1e-5));
    CHECK(luminance(glass->albedo(wo, kUv)) == Approx(1.0).margin(1e-5));
  }
  CHECK(glass->deltaProbability(Vec3::UnitZ(), kUv) == 1.0f);
}

TEST_CASE("materials: without transmittance a dielectric always reflects") {
  const BsdfPtr glass = bsdfOf("dielectric", {{"specular_transmittance", Rgb(0.0f, 0.0f, 0.0f)}});
  const Vec3 wo = directionAt(20.0);
  const auto s = glass->sampleDelta(wo, kUv, 0.999f);
  REQUIRE(s);
  CHECK(s->wi.z() > 0.0f);
  CHECK(s->weight.x() == Approx(fresnelDielectric(wo.z(), 1.5046 / 1.000277).reflectance));
}

TEST_CASE("materials: a thin slab reflects the sum of its internal reflections and transmits the rest straight") {
  const BsdfPtr pane = bsdfOf("thindielectric", {{"int_ior", 1.5}, {"ext_ior", 1.0}});
  for (const double elevation : {0.0, 60.0, 130.0}) {
    const Vec3 wo = directionAt(elevation, 40.0);
    const double r = fresnelDielectric(std::abs(wo.z()), 1.5).reflectance;
    double sum = r;
    for (double term = (1 - r) * (1 - r) * r; term > 1e-12; term *= r * r) sum += term;
    const auto mirrored = pane->sampleDelta(wo, kUv, static_cast<float>(sum) * 0.999f);
    const auto passed = pane->sampleDelta(wo, kUv, static_cast<float>(sum) * 1.001f);
    REQUIRE(mirrored);
    REQUIRE(passed);
    CHECK(mirrored->wi.isApprox(Vec3(-wo.x(), -wo.y(), wo.z())));
    CHECK(passed->wi.isApprox(-wo));
    CHECK(mirrored->weight.x() == Approx(1.0).margin(1e-5));
    CHECK(passed->weight.x() == Approx(1.0).margin(1e-5));
    CHECK(passed->eta == 1.0f);
  }
}

TEST_CASE("materials: a mask divides light between pass-through and the delta and smooth parts of its nested model") {
  const Rgb opacity(0.2f, 0.5f, 0.9f);
  const BsdfPtr nested = bsdfOf("plastic", {{"diffuse_reflectance", Rgb(0.8f, 0.4f, 0.2f)}});
  const BsdfPtr mask = bsdfOf("mask", {{"opacity", opacity}}, {nested});
  const Vec3 wo = directionAt(70.0, 10.0);
  const float p = mask->deltaProbability(wo, kUv);
  CHECK(p > 0.0f);
  CHECK(p < 1.0f);
  Rgb passed = Rgb::Zero();
  Rgb mirrored = Rgb::Zero();
  constexpr int kChoices = 20000;
  for (int i = 0; i < kChoices; ++i) {
    const auto s = mask->sampleDelta(wo, kUv, (static_cast<float>(i) + 0.5f) / kChoices);
    REQUIRE(s);
    (s->wi.isApprox(-wo) ? passed : mirrored) += s->weight / kChoices;
  }
  const auto specular = nested->sampleDelta(wo, kUv, 0.5f);
  REQUIRE(specular);
  CHECK((passed - (1.0f - opacity)).abs().maxCoeff() < 1e-3f);
  CHECK((mirrored - opacity * specular->weight).abs().maxCoeff() < 1e-3f);
  const Vec3 wi = directionAt(20.0);
  CHECK((mask->eval(wo, wi, kUv) - opacity * nested->eval(wo, wi, kUv)).abs().maxCoeff() < 1e-6f);
  CHECK(mask->mixture(wo, kUv).constant == Approx(nested->mixture(wo, kUv).constant * luminance(opacity)));

  const BsdfPtr solid = bsdfOf("mask", {{"opacity", 1.0}}, {bsdfOf("diffuse")});
  CHECK(solid->deltaProbability(wo, kUv) == 0.0f);
  CHECK_FALSE(solid->sampleDelta(wo, kUv, 0.5f));
  const BsdfPtr hole = bsdfOf("mask", {{"opacity", 0.0}}, {bsdfOf("diffuse")});
  CHECK(hole->deltaProbability(wo, kUv) == 1.0f);
}

TEST_CASE("materials: the delta and diffuse parts of smooth plastic sum to its albedo") {
  const BsdfPtr plastic = bsdfOf("plastic", {{"diffuse_reflectance", grey(0.5f)}});
  const Vec3 wo = directionAt(65.0);
  Rng rng(17);
  Mean albedo;
  for (int i = 0; i < 40000; ++i) {
    const float p = plastic->deltaProbability(wo, kUv);
    if (rng.uniform() < p) {
      albedo.add(luminance(plastic->sampleDelta(wo, kUv, rng.uniform())->weight) / p);
    } else {
      const auto s = plastic->sample(wo, kUv, rng.uniform(), rng.uniform2());
      albedo.add(s ? luminance(s->f) * s->wi.z() / (s->pdf * (1.0f - p)) : 0.0);
    }
  }
  CHECK(luminance(plastic->albedo(wo, kUv)) == Approx(albedo.value()).margin(4.0 * albedo.error()));
}

}  // namespace lobe
