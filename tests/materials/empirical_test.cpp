// Phong, Ward and rough diffuse models compared with closed forms and numerical integrals.

#include <catch2/catch.hpp>

#include "runtime/core/sampling.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

/// ∫ f cosθ dω over the upper hemisphere, first component, by the midpoint rule; equal steps of √θ resolve narrow peaks
/// about the normal.
double albedoByQuadrature(const Bsdf& bsdf, const Vec3& wo, int steps = 400) {
  double sum = 0.0;
  for (int i = 0; i < steps; ++i)
    for (int k = 0; k < steps; ++k) {
      const double x = (i + 0.5) / steps;
      const double theta = 0.5 * std::numbers::pi * x * x;
      const double phi = 2.0 * std::numbers::pi * (k + 0.5) / steps;
      const Vec3 wi = directionAt(theta * 180.0 / std::numbers::pi, phi * 180.0 / std::numbers::pi);
      sum += bsdf.eval(wo, wi, kUv).x() * std::cos(theta) * std::sin(theta) * x;
    }
  return sum * 2.0 * std::numbers::pi * std::numbers::pi / (steps * steps);
}

BsdfPtr ward(const std::string& variant, double alphaU, double alphaV) {
  return bsdfOf("ward", {{"variant", variant},
                         {"alpha_u", alphaU},
                         {"alpha_v", alphaV},
                         {"specular_reflectance", 1.0},
                         {"diffuse_reflectance", 0.0}});
}

}  // namespace

TEST_CASE("materials: the albedo of Phong at normal incidence and its values match the closed forms") {
  for (const double exponent : {0.0, 1.0, 10.0, 100.0}) {
    const BsdfPtr phong =
        bsdfOf("phong",
               {{"exponent", exponent}, {"specular_reflectance", 0.6}, {"diffuse_reflectance", Rgb(0.3f, 0.2f, 0.1f)}});
    CHECK(albedoByQuadrature(*phong, Vec3::UnitZ()) == Approx(0.9).epsilon(1e-3));
    // 30 degrees from the mirror direction, at 40 degrees.
    const double expected =
        (exponent + 2.0) / (2.0 * std::numbers::pi) * 0.6 * std::pow(std::cos(std::numbers::pi / 6.0), exponent) +
        0.3 / std::numbers::pi;
    CHECK(phong->eval(directionAt(40.0), directionAt(10.0, 180.0), kUv).x() == Approx(expected).epsilon(1e-4));
  }
  const BsdfPtr plain = bsdfOf("phong");
  CHECK(plain->mixture(Vec3::UnitZ(), kUv).glossy[0].tint == Approx(0.2f));
  CHECK(plain->mixture(Vec3::UnitZ(), kUv).constant == Approx(0.5f));
  CHECK(plain->lobes()[0]->key() == bsdfOf("phong", {{"exponent", 30.0}})->lobes()[0]->key());
  CHECK(plain->lobes()[0]->kind() == LobeKind::isotropic);
}

TEST_CASE("materials: the albedo of every Ward variant at normal incidence is its colour") {
  // The Gaussian is normalised only for small roughness. The balanced variant loses what is reflected below the
  // surface.
  for (const char* variant : {"ward", "ward-duer", "balanced"})
    CHECK(albedoByQuadrature(*ward(variant, 0.1, 0.05), Vec3::UnitZ(), 800) == Approx(1.0).epsilon(0.03));
}

TEST_CASE("materials: Ward's variants match the published formulas") {
  const Vec3 wo = directionAt(35.0, 20.0);
  const Vec3 wi = directionAt(50.0, 190.0);
  const Eigen::Vector3d h = (wo + wi).cast<double>();  // not normalised, as in the paper of the balanced model
  const double alphaU = 0.2, alphaV = 0.4;
  const double bell = std::exp(-(std::pow(h.x() / alphaU, 2) + std::pow(h.y() / alphaV, 2)) / (h.z() * h.z())) /
                      (std::numbers::pi * alphaU * alphaV);
  const double cosines = static_cast<double>(wo.z()) * wi.z();
  const auto value = [&](const char* variant) { return ward(variant, alphaU, alphaV)->eval(wo, wi, kUv).x(); };
  CHECK(value("ward") == Approx(0.25 * bell / std::sqrt(cosines)).epsilon(1e-4));
  CHECK(value("ward-duer") == Approx(0.25 * bell / cosines).epsilon(1e-4));
  CHECK(value("balanced") == Approx(bell * h.squaredNorm() / std::pow(h.z(), 4)).epsilon(1e-4));
  CHECK(bsdfOf("ward")->lobes()[0]->model() == "ward-balanced");
  CHECK(bsdfOf("ward")->lobes()[0]->kind() == LobeKind::isotropic);
  CHECK(ward("ward", 0.1, 0.2)->lobes()[0]->kind() == LobeKind::anisotropic);
}

TEST_CASE("materials: Ward's and Dür's variants are finite and reciprocal at grazing angles") {
  Rng rng(41);
  for (const char* variant : {"ward", "ward-duer"}) {
    const BsdfPtr bsdf = ward(variant, 0.3, 0.1);
    for (int i = 0; i < 500; ++i) {
      Vec3 wo = squareToCosineHemisphere(rng.uniform2());
      if (i % 2) wo = Vec3(wo.x(), wo.y(), 1e-30f).normalized();
      const Vec3 wi = i % 4 == 1 ? Vec3(-wo.x(), -wo.y(), wo.z()) : squareToCosineHemisphere(rng.uniform2());
      const float a = bsdf->eval(wo, wi, kUv).x();
      CHECK(std::isfinite(a));
      CHECK(std::isfinite(bsdf->pdf(wo, wi, kUv)));
      CHECK(a == Approx(bsdf->eval(wi, wo, kUv).x()).epsilon(1e-4));
    }
  }
}

TEST_CASE("materials: roughdiffuse with zero roughness equals diffuse") {
  for (const bool fast : {false, true}) {
    const BsdfPtr smooth = bsdfOf("roughdiffuse", {{"alpha", 0.0}, {"reflectance", 0.7}, {"use_fast_approx", fast}});
    const BsdfPtr diffuse = bsdfOf("diffuse", {{"reflectance", 0.7}});
    Rng rng(42);
    for (int i = 0; i < 100; ++i) {
      const Vec3 wo = squareToSphere(rng.uniform2());
      const Vec3 wi = squareToSphere(rng.uniform2());
      CHECK(smooth->eval(wo, wi, kUv).isApprox(diffuse->eval(wo, wi, kUv)));
      CHECK(smooth->pdf(wo, wi, kUv) == Approx(diffuse->pdf(wo, wi, kUv)));
      CHECK(smooth->albedo(wo, kUv).isApprox(diffuse->albedo(wo, kUv)));
    }
  }
}

TEST_CASE("materials: the albedo of roughdiffuse matches quadrature and its values are retroreflective") {
  for (const bool fast : {false, true})
    for (const double alpha : {0.2, 0.6})
      for (const double elevation : {0.0, 40.0, 75.0}) {
        const BsdfPtr rough =
            bsdfOf("roughdiffuse", {{"alpha", alpha}, {"reflectance", 0.8}, {"use_fast_approx", fast}});
        const Vec3 wo = directionAt(elevation, 30.0);
        INFO(fast << " " << alpha << " " << elevation);
        CHECK(rough->albedo(wo, kUv).x() == Approx(albedoByQuadrature(*rough, wo)).margin(2e-3));
        if (elevation > 0.0)
          CHECK(rough->eval(wo, wo, kUv).x() > 1.01f * rough->eval(wo, directionAt(elevation, 210.0), kUv).x());
      }
  // The fast approximation in closed form: σ² = α²/2, both directions at 60 degrees, azimuths 60 degrees apart.
  const double s = 0.5 * 0.6 * 0.6;
  const double root3 = std::sqrt(3.0);
  const double expected =
      0.8 / std::numbers::pi * (1.0 - 0.5 * s / (s + 0.33) + 0.45 * s / (s + 0.09) * 0.5 * (0.5 * root3) * root3);
  const BsdfPtr fast = bsdfOf("roughdiffuse", {{"alpha", 0.6}, {"reflectance", 0.8}, {"use_fast_approx", true}});
  CHECK(fast->eval(directionAt(60.0, 10.0), directionAt(60.0, 70.0), kUv).x() == Approx(expected).epsilon(1e-4));
  // The full model in closed form: 60 and 30 degrees, opposite azimuths.
  const double c = s / (s + 0.09);
  const double once = 1.0 - 0.5 * s / (s + 0.33) - 0.45 * c * (0.5 * root3 - 1.0 / 27.0) / root3;
  const double twice = 0.17 * s / (s + 0.13) * (1.0 + 1.0 / 9.0);
  const BsdfPtr full = bsdfOf("roughdiffuse", {{"alpha", 0.6}, {"reflectance", 0.8}});
  CHECK(full->eval(directionAt(60.0), directionAt(30.0, 180.0), kUv).x() ==
        Approx(0.8 / std::numbers::pi * (once + 0.8 * twice)).epsilon(1e-4));
  // Azimuths 90 degrees apart: only the oblique term remains, in which 4αβ/π² is 2/9 and the tangent 1.
  const double across = 1.0 - 0.5 * s / (s + 0.33) + 0.125 * c * std::pow(2.0 / 9.0, 2);
  CHECK(full->eval(directionAt(60.0), directionAt(30.0, 90.0), kUv).x() ==
        Approx(0.8 / std::numbers::pi * (across + 0.8 * 0.17 * s / (s + 0.13))).epsilon(1e-4));
}

TEST_CASE("materials: errors in empirical models are reported") {
  using Catch::Matchers::Contains;
  const auto message = [](const std::string& type,
                          std::initializer_list<std::pair<std::string, ParameterValue>> values) {
    try {
      bsdfOf(type, values);
    } catch (const ParameterError& error) {
      return error.name + ": " + error.what();
    }
    return std::string("no error");
  };
  CHECK_THAT(message("phong", {{"exponent", -1.0}}), Contains("exponent: ") && Contains("-1"));
  CHECK_THAT(message("phong", {{"exponent", constantTexture(grey(1.0f))}}), Contains("texture") && Contains("number"));
  CHECK_THAT(message("ward", {{"variant", std::string("wart")}}), Contains("wart") && Contains("ward-duer, balanced"));
  CHECK_THAT(message("ward", {{"alpha_u", -0.1}}), Contains("alpha_u: "));
  CHECK_THAT(message("ward", {{"alpha_v", constantTexture(grey(1.0f))}}), Contains("texture"));
  CHECK_THAT(message("roughdiffuse", {{"alpha", constantTexture(grey(1.0f))}}), Contains("no error"));
}

}  // namespace lobe
