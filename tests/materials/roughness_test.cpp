// Textured roughness: exact distributions for scattering, lobes at shared roughness levels for the fit.

#include <catch2/catch.hpp>

#include "materials/lobes/roughness_levels.h"
#include "materials/textures/bitmap.h"
#include "materials/textures/checkerboard.h"
#include "tests/support/chi2.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

/// A texture of one row with one pixel per value, without interpolation: pixel i is at u = (i + ½) / count.
TexturePtr steps(std::initializer_list<float> values) {
  auto image = std::make_shared<Image>(static_cast<int>(values.size()), 1);
  std::transform(values.begin(), values.end(), image->pixels.begin(), grey);
  BitmapOptions options;
  options.nearest = true;
  return makeBitmap(image, options);
}

BsdfPtr roughOf(const std::string& type, const ParameterValue& alpha) {
  return bsdfOf(type, {{"distribution", std::string("ggx")}, {"alpha", alpha}});
}

constexpr const char* kModels[] = {"roughconductor", "roughplastic", "roughdielectric"};

}  // namespace

TEST_CASE("materials: roughness levels are half an octave apart and end at one") {
  CHECK(roughnessOfLevel(kRoughnessLevels - 1) == 1.0);
  CHECK(roughnessOfLevel(0) == 1.0 / 128.0);
  CHECK(roughnessOfLevel(13) == Approx(std::sqrt(0.5)).epsilon(1e-15));
  for (int i = 0; i < kRoughnessLevels; ++i) CHECK(levelOfRoughness(roughnessOfLevel(i)) == Approx(i).margin(1e-12));
  CHECK(levelOfRoughness(1e-4) == 0.0);
  CHECK(levelOfRoughness(3.0) == kRoughnessLevels - 1);
}

TEST_CASE("materials: textures return the bounds of their luminance") {
  const TextureRange bitmap = steps({0.3f, 0.1f, 0.9f, std::nanf("")})->range();
  CHECK(bitmap.smallest == Approx(0.1f));
  CHECK(bitmap.largest == Approx(0.9f));
  const TextureRange board = makeCheckerboard(steps({0.2f, 0.4f}), constantTexture(grey(0.7f)))->range();
  CHECK(board.smallest == Approx(0.2f));
  CHECK(board.largest == Approx(0.7f));
  const TextureRange nothing = steps({std::nanf("")})->range();
  CHECK(nothing.smallest == nothing.largest);
}

TEST_CASE("materials: textured roughness scatters like a constant roughness of the same value") {
  const TexturePtr texture = steps({0.05f, 0.2f, 0.6f});
  Rng rng(41);
  for (const char* type : kModels) {
    const BsdfPtr textured = roughOf(type, texture);
    for (const auto& [u, alpha] : {std::pair{0.1f, 0.05f}, {0.5f, 0.2f}, {0.9f, 0.6f}}) {
      const BsdfPtr plain = roughOf(type, static_cast<double>(luminance(grey(alpha))));
      const Vec2 uv(u, 0.5f);
      double worst = 0.0;
      for (int i = 0; i < 300; ++i) {
        const Vec3 wo = directionAt(80.0 * rng.uniform(), 360.0 * rng.uniform());
        const float choice = rng.uniform();
        const auto s = textured->sample(wo, uv, choice, rng.uniform2());
        if (!s) continue;
        const Rgb expected = plain->eval(wo, s->wi, kUv);
        worst = std::max<double>(worst, ((s->f - expected).abs() / expected.max(1e-3f)).maxCoeff());
        worst = std::max<double>(worst, std::abs(s->pdf - plain->pdf(wo, s->wi, kUv)) / s->pdf);
      }
      INFO(type << " of " << alpha);
      // Plastic interpolates its transmittance between the tables of two levels.
      CHECK(worst < (std::string(type) == "roughplastic" ? 0.03 : 1e-4));
    }
  }
}

TEST_CASE("materials: samples of textured roughness match its density") {
  std::uint64_t seed = 700;
  const TexturePtr u = steps({0.03f, 0.3f, 2.0f}), v = steps({0.1f, 0.15f});
  const BsdfPtr models[] = {
      roughOf("roughplastic", u),
      bsdfOf("roughconductor", {{"alpha_u", u}, {"alpha_v", v}}),
      bsdfOf("roughdielectric", {{"alpha_u", 0.2}, {"alpha_v", v}}),
  };
  for (const BsdfPtr& bsdf : models)
    for (const float at : {0.2f, 0.4f, 0.9f}) {
      const Vec3 wo = directionAt(55.0, 100.0);
      const Vec2 uv(at, 0.5f);
      Rng rng(++seed);
      const auto sampler = [&]() -> std::optional<Vec3> {
        const float choice = rng.uniform();
        const auto s = bsdf->sample(wo, uv, choice, rng.uniform2());
        return s ? std::optional<Vec3>(s->wi) : std::nullopt;
      };
      const Chi2Result r = chi2Sphere(sampler, [&](const Vec3& wi) { return bsdf->pdf(wo, wi, uv); });
      INFO(seed << ": " << r.message);
      CHECK(r.passed(9));
      if (at != 0.4f) continue;
      const auto elsewhere = [&](const Vec3& wi) { return bsdf->pdf(wo, wi, Vec2(0.9f, 0.5f)); };
      CHECK_FALSE(chi2Sphere(sampler, elsewhere).passed(1000));
    }
}

TEST_CASE("materials: materials with textured roughness share the lobes of roughness levels") {
  for (const char* type : kModels) {
    INFO(type);
    const BsdfPtr a = roughOf(type, steps({0.13f, 0.3f}));
    const BsdfPtr b = roughOf(type, steps({0.2f, 0.24f, 0.21f}));
    const std::size_t sides = std::string(type) == "roughdielectric" ? 2 : 1;
    REQUIRE(a->lobes().size() == 4 * sides);  // 1/8, 0.18, 1/4, 0.35
    REQUIRE(b->lobes().size() == 2 * sides);
    CHECK(a->lobes()[1]->key() == b->lobes()[0]->key());
    CHECK(a->lobes()[2]->key() == roughOf(type, 0.25)->lobes()[0]->key());
    CHECK(a->lobes()[0]->kind() == LobeKind::isotropic);
    // A constant texture is equivalent to a number.
    CHECK(roughOf(type, steps({0.3f, 0.3f}))->lobes().size() == sides);
    CHECK(roughOf(type, steps({-1.0f, -1.0f}))->lobes()[0]->key() == roughOf(type, 1e-5)->lobes()[0]->key());
    // Values out of range and NaN are clamped.
    const BsdfPtr wild = roughOf(type, steps({-1.0f, 100.0f, std::nanf("")}));
    CHECK(wild->lobes().size() == kRoughnessLevels * sides);
    for (const float u : {0.1f, 0.5f, 0.9f}) {
      const Rgb f = wild->eval(directionAt(20.0), directionAt(20.0, 180.0), Vec2(u, 0.5f));
      CHECK(f.allFinite());
      CHECK(f.minCoeff() > 0.0f);
    }
  }
}

TEST_CASE("materials: between two roughness levels the mixture contains the lobes of both") {
  const TexturePtr texture = steps({0.125f, 0.15f, 0.3f, 0.25f});
  for (const char* type : kModels)
    for (const double side : {1.0, -1.0}) {
      const BsdfPtr bsdf = roughOf(type, texture);
      Vec3 wo = directionAt(40.0);
      wo.z() *= static_cast<float>(side);
      INFO(type << " side " << side);
      if (side < 0.0 && std::string(type) != "roughdielectric") continue;
      const int first = side > 0.0 ? 0 : 4;
      const LobeMixture between = bsdf->mixture(wo, Vec2(0.3f, 0.5f));
      REQUIRE(between.glossyCount == 2);
      CHECK(between.glossy[0].lobe == first);
      CHECK(between.glossy[1].lobe == first + 1);
      CHECK(between.glossy[0].tint + between.glossy[1].tint == Approx(1.0f));
      CHECK(between.glossy[1].tint == Approx(2.0 * std::log2(0.15 / 0.125)).margin(1e-4));
      // Their weighted sum approximates the exact lobe.
      const BsdfPtr exact = roughOf(type, 0.15);
      const Vec3 up(wo.x(), wo.y(), std::abs(wo.z()));
      for (const double elevation : {30.0, 40.0, 45.0}) {
        const Vec3 wi = directionAt(elevation, 180.0);
        double sum = 0.0;
        for (const LobeTint& tint : std::span(between.glossy).first(2))
          sum += tint.tint * bsdf->lobes()[static_cast<std::size_t>(tint.lobe)]->eval(up, wi);
        CHECK(sum == Approx(exact->lobes()[side > 0.0 ? 0 : 1]->eval(up, wi)).epsilon(0.08));
      }
      const LobeMixture onLevel = bsdf->mixture(wo, Vec2(0.9f, 0.5f));
      float total = 0.0f;
      for (int i = 0; i < onLevel.glossyCount; ++i)
        total += onLevel.glossy[static_cast<std::size_t>(i)].tint *
                 (onLevel.glossy[static_cast<std::size_t>(i)].lobe == first + 2 ? 1.0f : 0.0f);
      CHECK(total == Approx(1.0f).margin(1e-4));
    }
}

}  // namespace lobe
