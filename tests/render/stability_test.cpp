// Rendering must stay unbiased after training in scenes with little, uneven or extreme light.

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <vector>

#include <oneapi/tbb/global_control.h>

#include "runtime/guiding/field_data.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/training.h"
#include "tests/support/agreement.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr int kWidth = 12, kHeight = 9;
const std::array kSources{TrainFrom::photons, TrainFrom::paths, TrainFrom::both};

Camera lookAt(const Vec3& from, const Vec3& target, float fov) {
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.horizontalFov = fov;
  const Vec3 forward = (target - from).normalized(), left = Vec3::UnitY().cross(forward).normalized();
  camera.toWorld.block<3, 4>(0, 0) << left, forward.cross(left), forward, from;
  return camera;
}

int addDiffuse(Scene& scene, float albedo) {
  return addMaterial(scene, std::make_shared<Diffuse>(albedo));
}

/// A room with a lamp under the ceiling and a box on the floor.
Scene roomScene(float scale = 1, bool flipped = false) {
  Scene scene;
  const int wall = addDiffuse(scene, 0.6f);
  const auto at = [&](float x, float y, float z) { return Vec3(scale * x, scale * y, scale * z); };
  addShape(scene, box(at(-2, 0, -2), at(2, 3, 2), !flipped), wall);
  addShape(scene, box(at(-1, 0, 0), at(0, 1, 1), flipped), addDiffuse(scene, 0.8f));
  addEmitter(scene, rectangle(at(-0.5f, 2.7f, -0.5f), at(1, 0, 0), at(0, 0, 1)), 4, wall);
  scene.camera = lookAt(at(1.6f, 1.6f, -1.8f), at(-0.4f, 0.8f, 0.6f), 60);
  return scene;
}

TrainingPlan smallPlan(TrainFrom from) {
  TrainingPlan plan;
  plan.from = from;
  plan.passes = 2;
  plan.photons = 3000;
  plan.importons = 2000;
  plan.records.neighbours = 80;
  return plan;
}

/// A scene with its trained illumination.
struct Trial {
  Trial(Scene s, const TrainingPlan& plan)
      : scene(std::move(s)),
        ready(scene),
        camera(scene.camera, scene.filter),
        trained(trainIllumination(ready, camera, nullptr, plan)) {}
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;

  const IlluminationCache& cache() const { return cacheOf(trained.field); }
  Film render(const Integrator& integrator, int samples, std::uint64_t seed) const {
    Film film(camera.width(), camera.height());
    lobe::render(camera, integrator, film,
                 {seed, samples, std::nullopt, PixelSampling::sobol, PixelFiltering::importance});
    return film;
  }
  Film path(int samples) const { return render(PathIntegrator(ready, {}), samples, 1); }
  Film guided(int samples) const {
    const GuidedSampler sampler(scene, trained.field, nullptr);
    return render(GuidedIntegrator(ready, {}, sampler), samples, 2);
  }

  const Scene scene;
  const RenderScene ready;
  const RayCamera camera;
  const TrainedIllumination trained;
};

bool isUnit(const Vec3& v) {
  return std::abs(v.norm() - 1) < 1e-4f;
}

void checkRecords(const Trial& trial) {
  int bad = 0;
  for (const IlluminationRecord& r : trial.cache().records()) {
    bool good = r.position.allFinite() && isUnit(r.normal) && isUnit(r.tangent) && std::isfinite(r.radius) &&
                r.radius > 0 && r.background >= 0 && r.background <= 1 && r.samples > 0 && r.count >= 1;
    float weight = 0;
    for (const Gaussian& g : r.gaussians()) {
      weight += g.weight;
      good = good && g.weight >= 0 && std::isfinite(g.meanX + g.meanY) && g.cov.xx > 0 && g.cov.determinant() > 0;
    }
    if (!good || !(std::abs(weight - 1) < 1e-3f)) ++bad;
  }
  CHECK(bad == 0);
  for (const PassReport& pass : trial.trained.report.passes)
    if (pass.logLikelihood) CHECK(std::isfinite(*pass.logLikelihood));
}

/// Checks that no sample was negative or not finite and that all pixels are finite.
void checkFilm(const Film& film) {
  CHECK(film.dropped() == 0);
  for (const Rgb& pixel : film.mean().pixels) REQUIRE((pixel.allFinite() && pixel.minCoeff() >= 0));
}

/// Trains from every source and renders; the images must agree with the path tracer.
void checkUnbiased(const Scene& scene, int samples, const std::function<void(TrainingPlan&)>& change = {}) {
  std::vector<Block> truth;
  for (const TrainFrom from : kSources) {
    TrainingPlan plan = smallPlan(from);
    if (change) change(plan);
    const Trial trial(scene, plan);
    checkRecords(trial);
    if (truth.empty()) truth = blocks(trial.path(2 * samples), 3);
    const Film film = trial.guided(samples);
    checkFilm(film);
    INFO("source " << static_cast<int>(from) << ", " << trial.cache().records().size() << " records");
    CHECK(agree(truth, blocks(film, 3)));
  }
}

bool isBlack(const Film& film) {
  return std::ranges::all_of(film.mean().pixels, [](const Rgb& pixel) { return (pixel == 0).all(); });
}

/// Trains from every source; the rendered image must be black.
void checkBlack(const Scene& scene, const std::function<void(TrainingPlan&)>& change = {}) {
  for (const TrainFrom from : kSources) {
    TrainingPlan plan = smallPlan(from);
    if (change) change(plan);
    const Trial trial(scene, plan);
    checkRecords(trial);
    CHECK(isBlack(trial.guided(16)));
  }
}

}  // namespace

TEST_CASE("stability: training with too few particles") {
  const int photons = GENERATE(1, 3, 50);
  checkUnbiased(roomScene(), 64, [&](TrainingPlan& plan) {
    plan.photons = photons;
    plan.importons = photons;
    plan.passes = photons == 3 ? 20 : 1;
    if (photons == 50) plan.records.components = plan.records.neighbours = 1;
  });
}

TEST_CASE("stability: training with almost no time") {
  checkUnbiased(roomScene(), 64, [](TrainingPlan& plan) { plan.seconds = 1e-9; });
  TrainingPlan plan = smallPlan(TrainFrom::both);
  plan.seconds = 1e-9;
  plan.photons = plan.importons = 100'000'000;  // hours of them
  const Trial hurried(roomScene(), plan);
  REQUIRE(hurried.trained.report.passes.size() == 1);
  CHECK(hurried.cache().size() > 0);
}

TEST_CASE("stability: no records where no photon arrives") {
  Scene scene;
  addShape(scene, rectangle({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}), addDiffuse(scene, 0.6f));
  scene.camera = lookAt({0, 2, -2}, {0, 0, 0}, 60);
  SECTION("no light at all") {}
  SECTION("a lamp that faces away") {
    addEmitter(scene, rectangle({-1, 3, -1}, {0, 0, 2}, {2, 0, 0}), 3);
  }
  SECTION("lamps below a two-sided floor") {
    addEmitter(scene, rectangle({-1, -1, -1}, {0, 0, 2}, {2, 0, 0}), 1e6f);
    scene.lights.push_back(PointLight{{0, -0.01f, 0}, grey(10)});
  }
  SECTION("no geometry") {
    scene.shapes.clear();
    scene.lights.push_back(PointLight{{0, 1, 0}, grey(1)});
  }
  for (const TrainFrom from : kSources) {
    const Trial trial(scene, smallPlan(from));
    CHECK(trial.cache().records().empty());
    CHECK(isBlack(trial.guided(8)));
  }
}

TEST_CASE("stability: a closed dark room with light outside") {
  Scene scene;
  addShape(scene, box({-2, 0, -2}, {2, 3, 2}, true), addDiffuse(scene, 0.97f));
  scene.camera = lookAt({1.6f, 1.6f, -1.8f}, {-0.4f, 0.8f, 0.6f}, 60);
  scene.environment = environment(Image(4, 2, grey(100)));
  scene.lights.push_back(PointLight{{0, 4, 0}, grey(1000)});
  addEmitter(scene, Sphere{{5, 1, 0}, 1}, 100);
  checkBlack(scene, [](TrainingPlan& plan) { plan.importons = 4000; });
}

TEST_CASE("stability: all light from one point") {
  // A small lamp above a diffuse floor in a black room.
  Scene scene;
  const int black = addDiffuse(scene, 0.0f), floor = addDiffuse(scene, 0.7f);
  addShape(scene, box({-2, 0, -2}, {2, 3, 2}, true), black);
  addShape(scene, rectangle({-2, 0.01f, -2}, {0, 0, 4}, {4, 0, 0}), floor);
  const float size = GENERATE(0.2f, 1e-3f);
  addEmitter(scene, Disk{{0, 2, 0}, {size, 0, 0}, {0, 0, size}, false}, 1 / (size * size));
  scene.camera = lookAt({1.6f, 1.6f, -1.8f}, {0, 0, 0}, 60);
  SECTION("direct") {}
  SECTION("in a mirror where next-event estimation finds nothing") {
    addShape(scene, Disk{{0, 0.5f, 0}, {1.5f, 0, 0}, {0, 0, 1.5f}},
             addMaterial(scene, std::make_shared<HalfMirror>(0.3f, 0.4f, 0.5f)));
  }
  checkUnbiased(scene, 64);
}

TEST_CASE("stability: all light at grazing angles") {
  Scene scene;
  addShape(scene, rectangle({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}), addDiffuse(scene, 0.8f));
  // A light strip at the edge of the floor, facing along the floor; the second one is much lower.
  const float height = GENERATE(0.02f, 1e-3f);
  addEmitter(scene, rectangle({-2, 0, -2}, {0, height, 0}, {0, 0, 4}), 1 / height, addDiffuse(scene, 0.5f));
  scene.camera = lookAt({1.6f, 1.6f, -1.8f}, {0, 0, 0}, 60);
  checkUnbiased(scene, 64);
}

TEST_CASE("stability: training does not depend on the unit of length") {
  const Trial usual(roomScene(), smallPlan(TrainFrom::both));
  const auto truth = blocks(usual.path(128), 3);
  for (const float scale : {1e-4f, 1e4f}) {
    const Trial trial(roomScene(scale), smallPlan(TrainFrom::both));
    checkRecords(trial);
    CHECK(static_cast<double>(trial.cache().records().size()) ==
          Approx(static_cast<double>(usual.cache().records().size())).epsilon(0.05));
    const Film film = trial.guided(64);
    checkFilm(film);
    CHECK(agree(truth, blocks(film, 3)));
  }
}

TEST_CASE("stability: training on two-sided surfaces does not depend on their winding") {
  const Trial usual(roomScene(), smallPlan(TrainFrom::both));
  const Scene flipped = roomScene(1, true);
  checkUnbiased(flipped, 48);
  const Trial trial(flipped, smallPlan(TrainFrom::both));
  CHECK(trial.cache().records().size() > 100);
  CHECK(agree(blocks(usual.path(128), 3), blocks(trial.guided(64), 3)));
}

namespace {

/// Two rooms that share a thin wall at x = 0; the camera is in the right one and looks at the wall.
Scene twoRooms(float left, float right) {
  Scene scene;
  const int wall = addDiffuse(scene, 0.7f);
  addShape(scene, box({-2, 0, -1}, {2, 2, 1}, true), wall);
  addShape(scene, rectangle({0, 0, -1}, {0, 2, 0}, {0, 0, 2}), wall);
  addEmitter(scene, rectangle({-1.5f, 1.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}), left, wall);
  if (right > 0) addEmitter(scene, rectangle({1.2f, 0.3f, -0.6f}, {0.5f, 0, 0}, {0, 0, 0.3f}), right, wall);
  scene.camera = lookAt({1.9f, 1, 0}, {0, 1, 0.1f}, 70);
  return scene;
}

}  // namespace

TEST_CASE("stability: light does not leak through a thin wall") {
  SECTION("no light on the visible side") {
    const Scene scene = twoRooms(1e4f, 0);
    checkBlack(scene);
    const Trial trial(scene, smallPlan(TrainFrom::photons));
    // The floor continues under the wall and learns from both sides there, but only close to the wall.
    CHECK_FALSE(trial.cache().find({0, 1, 0}, Vec3::UnitX()));
    const float unit =
        smallPlan(TrainFrom::photons).records.unitFraction * trial.ready.tracer.bounds().diagonal().norm();
    for (const IlluminationRecord& r : trial.cache().records())
      CHECK((std::abs(r.normal.x()) < 0.5f && r.position.x() < unit));
  }
  SECTION("all light on the visible side") {
    Scene scene = twoRooms(1, 0);
    scene.camera = lookAt({-1.9f, 1, 0}, {0, 1, 0.1f}, 70);
    const Trial trial(std::move(scene), smallPlan(TrainFrom::photons));
    CHECK(trial.cache().find({0, 1, 0}, -Vec3::UnitX()));
    CHECK_FALSE(trial.cache().find({0, 1, 0}, Vec3::UnitX()));
  }
  SECTION("little light on the visible side") {
    const Scene scene = twoRooms(1e3f, 1);
    checkUnbiased(scene, 96);
  }
}

TEST_CASE("stability: a corridor of forty bounces") {
  Scene scene;
  const int wall = addDiffuse(scene, 0.95f);
  addShape(scene, box({-0.5f, 0, 0}, {0.5f, 1, 20}, true), wall);
  for (int i = 1; i < 10; ++i)  // baffles, alternately left and right
    addShape(scene, rectangle({i % 2 ? -0.5f : -0.1f, 0, 2.0f * i}, {0.6f, 0, 0}, {0, 1, 0}), wall);
  addEmitter(scene, rectangle({-0.5f, 0, 19.9f}, {0, 1, 0}, {1, 0, 0}), 100, wall);
  scene.camera = lookAt({0, 0.5f, GENERATE(0.1f, 10.1f)}, {0, 0.5f, 30}, 60);
  checkUnbiased(scene, 32);
}

TEST_CASE("stability: a lamp a million times brighter than the visible one") {
  checkUnbiased(twoRooms(1e6f, 1), 128);
}

TEST_CASE("stability: training goes on after its time limit only if it is extended") {
  const Scene scene = roomScene();
  const RenderScene ready(scene);
  const RayCamera camera(scene.camera, scene.filter);
  TrainingPlan plan = smallPlan(TrainFrom::both);
  plan.passes = 6;
  plan.seconds = 1e-9;
  std::vector<std::size_t> seen;
  const auto passesWith = [&](std::vector<std::optional<double>> limits) {
    seen.clear();
    const auto extend = [&](const Field& field) {
      seen.push_back(field.records());
      return seen.size() <= limits.size() ? limits[seen.size() - 1] : std::nullopt;
    };
    return trainIllumination(ready, camera, nullptr, plan, {}, Field(), extend).report.passes.size();
  };
  CHECK(trainIllumination(ready, camera, nullptr, plan).report.passes.size() == 1);
  CHECK(passesWith({}) == 1);
  REQUIRE(seen.size() == 1);
  CHECK(seen[0] > 0);
  CHECK(passesWith({2e-9, std::nullopt}) == 1);
  CHECK(seen.size() == 2);
  CHECK(passesWith({1e9}) == 6);
  CHECK(seen.size() == 1);
}

TEST_CASE("stability: training does not depend on the number of threads") {
  const Scene scene = roomScene();
  const auto train = [&](TrainFrom from, std::size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    return trainIllumination(RenderScene(scene), RayCamera(scene.camera, scene.filter), nullptr, smallPlan(from)).field;
  };
  for (const TrainFrom from : kSources) {
    const Field first = train(from, 1), second = train(from, 2);
    const std::vector<IlluminationRecord> one = cacheOf(first).records(), two = cacheOf(second).records();
    REQUIRE(one.size() > 100);
    REQUIRE(one.size() == two.size());
    int different = 0;
    for (std::size_t i = 0; i < one.size(); ++i) {
      const IlluminationRecord &a = one[i], &b = two[i];
      const bool same = a.position == b.position && a.normal == b.normal && a.radius == b.radius &&
                        a.background == b.background && a.samples == b.samples && a.count == b.count &&
                        std::memcmp(a.components.data(), b.components.data(), a.gaussians().size_bytes()) == 0;
      if (!same) ++different;
    }
    CHECK(different == 0);
  }
}
