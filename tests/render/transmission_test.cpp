// Next-event estimation through panes, slabs, balls and masks: against closed forms, and against paths that find the
// same light by sampling directions alone.

#include <numbers>

#include <catch2/catch.hpp>

#include "materials/lobes/fresnel.h"
#include "materials/registry.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr float kAlbedo = 0.5f;
constexpr double kIor = 1.5;

BsdfPtr glass(const char* type) {
  Parameters parameters;
  parameters.set("int_ior", kIor);
  parameters.set("ext_ior", 1.0);
  return makeBsdf(type, parameters);
}

/// A small diffuse disk at the origin that faces up, so small that it does not light itself.
Scene smallReceiver() {
  Scene scene;
  addShape(scene, Disk{{0, 0, 0}, {0, 0, 1e-3f}, {1e-3f, 0, 0}},
           addMaterial(scene, std::make_shared<Diffuse>(kAlbedo)));
  return scene;
}

const Ray kOntoReceiver{{0, 0.01f, 0}, -Vec3::UnitY()};

/// Radiance 1 above the horizon, 0 below.
Environment upperHalf() {
  Image image(64, 32, grey(0));
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 64; ++x) image.at(x, y) = grey(1);
  return environment(image);
}

/// A sky with a small and bright sun near the zenith.
Environment withSun() {
  Image image(64, 32, grey(0.2f));
  for (int x = 20; x < 28; ++x) image.at(x, 2) = grey(300);
  return environment(image);
}

/// ∫ (1 − R) cosθ/π dω over the hemisphere, with the reflectance of a slab of glass.
double slabTransmittance() {
  constexpr int kSteps = 20000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double cosine2 = (i + 0.5) / kSteps;  // uniform in cos²θ
    const double r = fresnelDielectric(std::sqrt(cosine2), kIor).reflectance;
    sum += 1 - 2 * r / (1 + r);
  }
  return sum / kSteps;
}

/// The radiance of the receiver, with next-event estimation through up to `surfaces` surfaces.
Moments seen(const Scene& scene, int surfaces, int samples, int maxDepth = 30) {
  const RenderScene ready(scene, surfaces);
  PathOptions options;
  options.maxDepth = maxDepth;
  return estimate(PathIntegrator(ready, options), kOntoReceiver, samples);
}

}  // namespace

TEST_CASE("transmission: light through a pane has the transmittance of a slab") {
  Scene scene = smallReceiver();
  scene.environment = upperHalf();
  addShape(scene, rectangle({-1e4f, 1, -1e4f}, {0, 0, 2e4f}, {2e4f, 0, 0}),
           addMaterial(scene, glass("thindielectric")));
  const double expected = kAlbedo * slabTransmittance();
  for (const int surfaces : {0, 16}) CHECK(deviation(seen(scene, surfaces, 100000), expected) < kMaxDeviation);
}

TEST_CASE("transmission: a slab of two refracting interfaces transmits what a pane does") {
  Scene scene = smallReceiver();
  scene.environment = upperHalf();
  addShape(scene, box({-1e3f, 1, -1e3f}, {1e3f, 1.1f, 1e3f}, false), addMaterial(scene, glass("dielectric")));
  const double expected = kAlbedo * slabTransmittance();
  for (const int surfaces : {0, 1, 2, 16})
    CHECK(deviation(seen(scene, surfaces, 200000, 200), expected) < kMaxDeviation);
}

TEST_CASE("transmission: a glass ball in uniform light changes nothing") {
  Scene scene = smallReceiver();
  scene.environment = environment(Image(8, 4, grey(1)));
  addShape(scene, Sphere{{0.2f, 1, 0.1f}, 0.6f}, addMaterial(scene, glass("dielectric")));
  for (const int surfaces : {0, 1, 16}) CHECK(deviation(seen(scene, surfaces, 200000, 200), kAlbedo) < kMaxDeviation);
}

TEST_CASE("transmission: next-event estimation through refraction agrees with paths that find the light by chance") {
  Scene scene = smallReceiver();
  scene.environment = withSun();
  addShape(scene, Sphere{{0.1f, 1, 0}, 0.6f}, addMaterial(scene, glass("dielectric")));
  const Moments chance = seen(scene, 0, 400000), followed = seen(scene, 16, 400000), one = seen(scene, 1, 400000);
  CHECK(deviation(chance, followed) < kMaxDeviation);
  CHECK(deviation(chance, one) < kMaxDeviation);
}

TEST_CASE("transmission: radiance is scaled by the square of the index where only one interface is passed") {
  // The receiver is inside the glass.
  Scene scene = smallReceiver();
  scene.environment = withSun();
  addShape(scene, box({-3, -1, -3}, {3, 1, 3}, false), addMaterial(scene, glass("dielectric")));
  const Moments chance = seen(scene, 0, 400000), followed = seen(scene, 16, 400000);
  CHECK(deviation(chance, followed) < kMaxDeviation);
  CHECK(followed.error() < 0.7 * chance.error());
}

TEST_CASE("transmission: area lights are found through panes and half-open masks", "[heavy]") {
  const char* type = GENERATE("thindielectric", "mask", "dielectric");
  CAPTURE(type);
  Scene scene = smallReceiver();
  addEmitter(scene, rectangle({-0.5f, 2, -0.5f}, {1, 0, 0}, {0, 0, 1}), 5);
  BsdfPtr pane;
  if (std::string(type) == "mask") {
    Parameters half;
    half.set("opacity", 0.4);
    half.addChild(std::make_shared<Diffuse>(0.3f));
    pane = makeBsdf("mask", half);
  } else {
    pane = glass(type);
  }
  addShape(scene, box({-3, 1, -3}, {3, 1.2f, 3}, false), addMaterial(scene, pane));
  const Moments chance = seen(scene, 0, 400000), followed = seen(scene, 16, 400000);
  CHECK(deviation(chance, followed) < kMaxDeviation);
  if (std::string(type) != "dielectric") CHECK(followed.error() < 0.7 * chance.error());
}

TEST_CASE("transmission: a point light shines through a pane") {
  Scene scene = smallReceiver();
  scene.lights = {PointLight{{0, 2, 0}, grey(3)}};
  addShape(scene, rectangle({-1, 1, -1}, {0, 0, 2}, {2, 0, 0}), addMaterial(scene, glass("thindielectric")));
  const double r = fresnelDielectric(1.0, kIor).reflectance;
  const double expected = kAlbedo / std::numbers::pi * 3 / 4 * (1 - 2 * r / (1 + r));
  CHECK(seen(scene, 16, 16).mean() == Approx(expected).epsilon(1e-4));
  CHECK(seen(scene, 0, 16).mean() == 0);
}

TEST_CASE("transmission: the maximum depth counts the surfaces that next-event estimation passes") {
  Scene scene = smallReceiver();
  scene.environment = upperHalf();
  addShape(scene, rectangle({-1e4f, 1, -1e4f}, {0, 0, 2e4f}, {2e4f, 0, 0}),
           addMaterial(scene, glass("thindielectric")));
  CHECK(seen(scene, 16, 1000, 2).mean() == 0);
  CHECK(seen(scene, 16, 1000, 3).mean() > 0);
}
