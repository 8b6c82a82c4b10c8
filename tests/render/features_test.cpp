// Albedo, normal and depth of pixels, against closed forms: seen directly, through a pane and in a mirror; and the
// accumulation over samples.

#include "runtime/render/integrators/features.h"

#include <limits>

#include "materials/lobes/fresnel.h"
#include "materials/registry.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr float kAlbedo = 0.3f;

/// A camera at the origin that looks along +z, with a field of view of 90 degrees.
Camera lookingAlongZ(int size) {
  Camera camera;
  camera.horizontalFov = 90;
  camera.width = camera.height = size;
  return camera;
}

/// A diffuse wall at z = 4.
Scene wall() {
  Scene scene;
  scene.camera = lookingAlongZ(8);
  addShape(scene, rectangle({-50, -50, 4}, {0, 100, 0}, {100, 0, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(kAlbedo)));
  return scene;
}

BsdfPtr glass(const char* type) {
  Parameters parameters;
  parameters.set("int_ior", 1.5);
  parameters.set("ext_ior", 1.0);
  return makeBsdf(type, parameters);
}

Features along(const Scene& scene, const Vec3& direction) {
  const RenderScene ready(scene);
  const RayCamera camera(scene.camera, scene.filter);
  return featuresAlong(ready, camera, {Vec3::Zero(), direction.normalized()}, scene.emitterVisibility);
}

bool near(const Vec3& a, const Vec3& b) {
  return (a - b).norm() < 1e-5f;
}

const Vec3 kOblique(0.5f, 0.2f, 1);

}  // namespace

TEST_CASE("features: a wall has its albedo, its normal towards the camera, and its depth along the axis") {
  for (const Vec3& direction : {Vec3(0, 0, 1), kOblique}) {
    const Features f = along(wall(), direction);
    CHECK((f.albedo - kAlbedo).abs().maxCoeff() < 1e-6f);
    CHECK(near(f.normal, {0, 0, -1}));
    CHECK(f.depth == Approx(4));
  }
  Scene back = wall();  // seen from behind
  back.camera.toWorld.topRightCorner<3, 1>() = Vec3(0, 0, 10);
  const RenderScene ready(back);
  const Features f = featuresAlong(ready, RayCamera(back.camera, back.filter), {Vec3(0, 0, 10), -Vec3::UnitZ()},
                                   EmitterVisibility::shown);
  CHECK(near(f.normal, {0, 0, 1}));
}

TEST_CASE("features: nothing is seen where a ray leaves the scene") {
  const Features f = along(wall(), {0, 0, -1});
  CHECK(f.albedo.isZero());
  CHECK(f.normal.isZero());
  CHECK(f.depth == kNoDepth);
}

TEST_CASE("features: depths are in the units of the file") {
  Scene scene = wall();
  scene.scale = 4;
  CHECK(along(scene, kOblique).depth == Approx(1));
}

TEST_CASE("features: a mirror shows albedo and normal of what it reflects, at its own depth") {
  Scene scene = wall();
  // At z = 2, turned by 45 degrees: it reflects +z to +x, where a second wall is.
  addShape(scene, rectangle({-1, -50, 1}, {0, 100, 0}, {2, 0, 2}),
           addMaterial(scene, makeBsdf("conductor", Parameters())));
  addShape(scene, rectangle({9, -50, -50}, {0, 0, 100}, {0, 100, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(0.7f)));
  const Features f = along(scene, {0, 0, 1});
  CHECK((f.albedo - 0.7f).abs().maxCoeff() < 1e-6f);
  CHECK(near(f.normal, {-1, 0, 0}));
  CHECK(f.depth == Approx(2));
}

TEST_CASE("features: a pane shows what is behind it, and what it reflects by its share") {
  Scene scene = wall();
  addShape(scene, rectangle({-50, -50, 2}, {0, 100, 0}, {100, 0, 0}), addMaterial(scene, glass("thindielectric")));
  addShape(scene, rectangle({-50, -50, -3}, {100, 0, 0}, {0, 100, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(0.9f)));
  SECTION("little is reflected: only what is behind it") {
    const Features f = along(scene, {0, 0, 1});
    CHECK((f.albedo - kAlbedo).abs().maxCoeff() < 1e-6f);
    CHECK(near(f.normal, {0, 0, -1}));
    CHECK(f.depth == Approx(2));
  }
  SECTION("much is reflected: both by the Fresnel reflectance") {
    const Vec3 direction = Vec3(3, 0, 1).normalized();
    const double once = fresnelDielectric(direction.z(), 1.5).reflectance, reflected = 2 * once / (1 + once);
    REQUIRE(reflected > 0.15);
    const Features f = along(scene, direction);
    CHECK(f.albedo.y() == Approx(kAlbedo + (0.9f - kAlbedo) * reflected).epsilon(1e-4));
    CHECK(f.normal.z() == Approx(reflected - (1 - reflected)).epsilon(1e-4));
  }
}

TEST_CASE("features: glass with two sides bends the ray") {
  Scene scene;
  scene.camera = lookingAlongZ(8);
  addShape(scene, box({-50, -50, 2}, {50, 50, 3}, false), addMaterial(scene, glass("dielectric")));
  // Behind the slab the ray is displaced; two halves of a wall differ in albedo at the place where it arrives.
  const Vec3 direction = Vec3(1, 0, 1).normalized();
  const double inside = std::asin(std::sin(kPi / 4) / 1.5);
  const auto arrival = static_cast<float>(4 - 1 + std::tan(inside));  // at z = 4
  for (const float side : {-1.0f, 1.0f}) {
    const float from = side < 0 ? -50 : arrival;
    addShape(scene, rectangle({from, -50, 4}, {0, 100, 0}, {side < 0 ? arrival + 50 : 50, 0, 0}),
             addMaterial(scene, std::make_shared<Diffuse>(side < 0 ? 0.2f : 0.8f)));
  }
  const auto albedoAt = [&](float shift) {
    const RenderScene ready(scene);
    return featuresAlong(ready, RayCamera(scene.camera, scene.filter), {Vec3(shift, 0, 0), direction},
                         EmitterVisibility::shown)
        .albedo.y();
  };
  CHECK(albedoAt(-0.01f) == Approx(0.2f));
  CHECK(albedoAt(0.01f) == Approx(0.8f));
}

// From behind, the metal has no sample.
TEST_CASE("features: the rear of a pane that is blended with metal shows what is behind it") {
  const double ofGlass = GENERATE(0.15, 0.5, 0.8);
  const bool metalFirst = GENERATE(true, false);
  CAPTURE(ofGlass, metalFirst);
  Parameters parameters;
  parameters.set("weight", metalFirst ? ofGlass : 1 - ofGlass);  // of the second part
  for (const bool isMetal : {metalFirst, !metalFirst})
    parameters.addChild(isMetal ? makeBsdf("conductor", Parameters()) : glass("thindielectric"));
  Scene scene = wall();
  addShape(scene, rectangle({-50, -50, 2}, {100, 0, 0}, {0, 100, 0}),
           addMaterial(scene, makeBsdf("blendbsdf", parameters)));
  const Features f = along(scene, {0, 0, 1});
  CHECK((f.albedo - kAlbedo).abs().maxCoeff() < 1e-6f);
  CHECK(near(f.normal, {0, 0, -1}));
  CHECK(f.depth == Approx(2));
}

TEST_CASE("features: surfaces through which everything passes have no depth") {
  Scene scene = wall();
  addShape(scene, rectangle({-50, -50, 1}, {0, 100, 0}, {100, 0, 0}), addMaterial(scene, makeBsdf("null", {})));
  const Features f = along(scene, kOblique);
  CHECK(f.depth == Approx(4));
  CHECK(f.albedo.y() == Approx(kAlbedo));
}

TEST_CASE("features: rays between two mirrors end") {
  Scene scene;
  scene.camera = lookingAlongZ(8);
  const int mirror = addMaterial(scene, makeBsdf("conductor", Parameters()));
  addShape(scene, rectangle({-50, -50, 1}, {0, 100, 0}, {100, 0, 0}), mirror);
  addShape(scene, rectangle({-50, -50, -1}, {100, 0, 0}, {0, 100, 0}), mirror);
  const Features f = along(scene, {0, 0, 1});
  CHECK(f.albedo.allFinite());
  CHECK(f.normal.norm() == Approx(1));
}

TEST_CASE("features: a film has the means over the samples of each pixel, and the smallest depth") {
  Scene scene = wall();
  // A nearer wall whose edge passes through the pixels of column 4.
  addShape(scene, rectangle({0.2f, -50, 2}, {0, 100, 0}, {100, 0, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(0.9f)));
  const RenderScene ready(scene);
  const RayCamera camera(scene.camera, scene.filter);
  const PathIntegrator integrator(ready, {});
  RenderOptions options;
  options.samples = 50;  // no power of two, for which Sobol' points at other indices have the same mean
  options.firstSample = 5;
  Film film(8, 8);
  render(camera, integrator, film, options);
  FeatureFilm once(8, 8), twice(8, 8);
  once.addMissing(film, ready, camera, options);
  Film half(8, 8);
  options.samples = 20;
  render(camera, integrator, half, options);
  twice.addMissing(half, ready, camera, options);
  twice.addMissing(film, ready, camera, options);
  int mixed = 0;
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) {
      double albedo = 0;
      float nearest = kNoDepth;
      for (int s = 0; s < 50; ++s) {
        Sampler rng = options.sampler(static_cast<std::uint64_t>(y) * 8 + x, s);
        const Features f = featuresAlong(ready, camera, camera.sample(x, y, rng), EmitterVisibility::shown);
        albedo += f.albedo.y() / 50;
        nearest = std::min(nearest, f.depth);
      }
      CHECK(once.albedo().at(x, y).y() == Approx(albedo));
      CHECK(once.depth().at(x, y).y() == nearest);
      CHECK((once.albedo().at(x, y) == twice.albedo().at(x, y)).all());
      CHECK((once.normal().at(x, y) == twice.normal().at(x, y)).all());
      mixed += albedo > 0.31 && albedo < 0.89;
    }
  CHECK(mixed == 8);
}

TEST_CASE("features: the variance of a pixel is that among pictures with other seeds") {
  Scene scene = wall();
  scene.camera = lookingAlongZ(4);
  addEmitter(scene, rectangle({-3, 5, 1}, {6, 0, 0}, {0, 0, 2}), 5);
  const RenderScene ready(scene);
  const RayCamera camera(scene.camera, scene.filter);
  const PathIntegrator integrator(ready, {});
  constexpr int kSeeds = 400;
  const auto ratio = [&](PixelSampling sampling) {
    std::vector<Moments> means(16), variances(16);
    for (int seed = 1; seed <= kSeeds; ++seed) {
      RenderOptions options;
      options.seed = static_cast<std::uint64_t>(seed);
      options.samples = 16;
      options.sampling = sampling;
      Film film(4, 4);
      render(camera, integrator, film, options);
      for (std::size_t i = 0; i < 16; ++i) {
        means[i].add(film.mean().pixels[i].y());
        variances[i].add(film.varianceOfMean().pixels[i].y());
      }
    }
    double among = 0, estimated = 0;
    for (std::size_t i = 0; i < 16; ++i) {
      among += kSeeds * means[i].error() * means[i].error();
      estimated += variances[i].mean();
    }
    return estimated / among;
  };
  // 16 sums of 400 squares: the standard error of the ratio is about 2 %.
  CHECK(std::abs(ratio(PixelSampling::independent) - 1) < 0.1);
  CHECK(ratio(PixelSampling::sobol) > 1);
}

TEST_CASE("render: a film drops and counts samples that are negative or not finite") {
  Film film(2, 1);
  film.add(0, 0, {1, 2, 3});
  film.add(0, 0, {std::numeric_limits<float>::quiet_NaN(), 0, 0});
  film.add(0, 0, {0, kInfinity, 0});
  film.add(0, 0, {0, 0, -1e-9f});
  film.add(0, 0, {3, 2, 1});
  CHECK(film.dropped() == 3);
  const Image mean = film.mean();
  CHECK((mean.at(0, 0) - Rgb(2, 2, 2)).abs().maxCoeff() < 1e-7f);
  CHECK(mean.at(1, 0).isZero());
  const Image variance = film.varianceOfMean();
  CHECK((variance.at(0, 0) - Rgb(1, 0, 1)).abs().maxCoeff() < 1e-7f);
  CHECK(variance.at(1, 0).x() == 0);
}
