// The part of a scene that a camera sees: large surroundings must not change what is learnt about a room.

#include <cmath>

#include <oneapi/tbb/global_control.h>

#include "runtime/guiding/field_data.h"
#include "runtime/guiding/illumination_cache.h"
#include "runtime/render/training/training.h"
#include "runtime/render/training/visible_region.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

/// A room of 4 × 3 × 4 m with a window, seen from one of its walls, below a uniform sky.
Scene roomWithWindow() {
  Scene scene;
  const int diffuse = addMaterial(scene, std::make_shared<Diffuse>(0.6f));
  const auto slab = [&](const Vec3& low, const Vec3& high) { addShape(scene, box(low, high, false), diffuse); };
  slab({0, -0.1f, 0}, {4, 0, 4});
  slab({0, 3, 0}, {4, 3.1f, 4});
  slab({0, 0, -0.1f}, {4, 3, 0});
  slab({0, 0, 4}, {4, 3, 4.1f});
  slab({4, 0, 0}, {4.1f, 3, 4});
  // Below, above and beside the window.
  slab({-0.1f, 0, 0}, {0, 1, 4});
  slab({-0.1f, 2, 0}, {0, 3, 4});
  slab({-0.1f, 1, 0}, {0, 2, 1.5f});
  slab({-0.1f, 1, 2.5f}, {0, 2, 4});
  scene.environment = environment(Image(16, 8, grey(1)));
  scene.camera.width = scene.camera.height = 32;
  scene.camera.horizontalFov = 70;
  // From (3.5, 1.5, 3.5) towards the opposite corner.
  const float h = std::sqrt(0.5f);
  scene.camera.toWorld.block<3, 4>(0, 0) << -h, 0, -h, 3.5f, 0, 1, 0, 1.5f, h, 0, -h, 3.5f;
  return scene;
}

/// The same on a square of ground of the given width.
Scene onGround(float width) {
  Scene scene = roomWithWindow();
  const float half = width / 2;
  addShape(scene, rectangle({-half, -1, -half}, {0, 0, width}, {width, 0, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(0.3f)));
  return scene;
}

RayCamera cameraOf(const Scene& scene) {
  return {scene.camera, {}};
}

/// What a short training has stored and learnt.
struct Learnt {
  double particles;
  float largestRadius;
};

Learnt train(const Scene& scene) {
  RenderScene ready(scene);
  const RayCamera camera = cameraOf(scene);
  ready.lights.focus(visibleRegion(ready, camera, 1));
  TrainingPlan plan;
  plan.from = TrainFrom::photons;
  plan.passes = 2;
  plan.photons = 20000;
  plan.importons = 10000;
  const TrainedIllumination trained = trainIllumination(ready, camera, nullptr, plan);
  float radius = 0;
  for (const IlluminationRecord& record : cacheOf(trained.field).records()) radius = std::max(radius, record.radius);
  return {static_cast<double>(trained.report.particles()), radius};
}

}  // namespace

TEST_CASE("visible region: of a small scene it is the bounding box") {
  const Scene scene = roomWithWindow();
  const RenderScene ready(scene);
  const Eigen::AlignedBox3f region = visibleRegion(ready, cameraOf(scene), 1);
  CHECK(region.isApprox(ready.tracer.bounds(), 0));
}

TEST_CASE("visible region: large surroundings do not count") {
  const Scene scene = onGround(4000);
  const RenderScene ready(scene);
  const Eigen::AlignedBox3f region = visibleRegion(ready, cameraOf(scene), 1);
  CHECK(region.contains(Vec3(0, 0, 0)));
  CHECK(region.contains(Vec3(4, 3, 4)));
  CHECK(region.diagonal().norm() < 20);
  // It depends on the seed, not on the number of threads.
  const oneapi::tbb::global_control one(oneapi::tbb::global_control::max_allowed_parallelism, 1);
  CHECK(visibleRegion(ready, cameraOf(scene), 1).isApprox(region, 0));
}

TEST_CASE("visible region: a camera that sees nothing gets the bounding box") {
  Scene scene = roomWithWindow();
  scene.camera.toWorld.topRightCorner<3, 1>() = Vec3(-50, 50, -50);
  const RenderScene ready(scene);
  CHECK(visibleRegion(ready, cameraOf(scene), 1).isApprox(ready.tracer.bounds(), 0));
}

TEST_CASE("visible region: photons and records of a room do not depend on the size of the ground around it") {
  const Learnt small = train(onGround(12)), large = train(onGround(8000));
  CHECK(small.particles > 1000);
  CHECK(large.particles > 0.5 * small.particles);
  CHECK(large.largestRadius < 2 * small.largestRadius);
}

TEST_CASE("visible region: photons that start on its disc pass through it, from outside the scene") {
  const Scene scene = onGround(4000);
  RenderScene ready(scene);
  const Eigen::AlignedBox3f room(Vec3(-0.5f, -0.5f, -0.5f), Vec3(4.5f, 3.5f, 4.5f));
  ready.lights.focus(room);
  const SceneSphere& region = ready.lights.region();
  CHECK(region.diagonal() == Approx(room.diagonal().norm()));
  Rng rng(4);
  for (int i = 0; i < 1000; ++i) {
    const auto from = ready.lights.environment()->sample(rng.uniform2());
    REQUIRE(from);
    const Vec2 u = rng.uniform2();
    const EmittedPhoton photon = ready.lights.photonFromEnvironment(*from, region, u);
    CHECK((photon.ray.origin - ready.tracer.bounds().center()).norm() > 0.5f * ready.tracer.bounds().diagonal().norm());
    const Vec3 towards = region.centre - photon.ray.origin;
    CHECK((towards - towards.dot(photon.ray.direction) * photon.ray.direction).norm() < 1.001f * region.radius);
    const auto found = region.coordinates(photon.ray.origin, from->wi);
    if (u.x() < 0.99f) {
      REQUIRE(found);
      CHECK(found->x() == Approx(u.x()).margin(2e-3));
    }
  }
  CHECK_FALSE(region.coordinates(Vec3(100, 0, 0), Vec3::UnitY()));
}

TEST_CASE("visible region: a scene without shapes keeps finite powers of its lights") {
  Scene scene;
  scene.environment = environment(Image(16, 8, grey(1)));
  scene.camera.width = scene.camera.height = 8;
  RenderScene ready(scene);
  ready.lights.focus(visibleRegion(ready, cameraOf(scene), 1));
  CHECK(std::isfinite(ready.lights.region().diagonal()));
  CHECK(ready.lights.environmentProbability() == 1);
}

TEST_CASE("visible region: a picture of direct light has the vertices that the camera sees") {
  const Scene scene = onGround(4000);
  const RenderScene ready(scene);
  const Eigen::AlignedBox3f all = visibleRegion(ready, cameraOf(scene), 1);
  const Eigen::AlignedBox3f direct = visibleRegion(ready, cameraOf(scene), 1, 2);
  CHECK(all.contains(direct));
  CHECK(direct.diagonal().norm() < 0.99f * all.diagonal().norm());
}
