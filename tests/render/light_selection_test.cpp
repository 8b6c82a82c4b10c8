// The choice of lights for next-event estimation: the light tree, the tiles of the environment, and learnt cells.

#include <cstring>
#include <numeric>

#include <oneapi/tbb/global_control.h>

#include "runtime/render/integrators/renderer.h"
#include "runtime/render/lights/delta_lights.h"
#include "runtime/render/training/light_learning.h"
#include "tests/support/agreement.h"
#include "tests/support/chi2.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

Image sunnySky() {
  Image image(32, 16);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x) image.at(x, y) = Rgb(0.2f + 0.04f * x, 0.3f, 0.1f * (16 - y));
  image.at(20, 3) = grey(5);
  return image;
}

/// A floor below a roof with an opening, lit by lights of all kinds. The small rectangles form one cluster with others.
Scene litFloor() {
  Scene scene;
  const int diffuse = addMaterial(scene, std::make_shared<Diffuse>(0.7f));
  const int mirror = addMaterial(scene, std::make_shared<HalfMirror>(0.4f, 0.4f, 0.5f));
  addShape(scene, rectangle({-3, 0, -3}, {0, 0, 6}, {6, 0, 0}), mirror);
  addShape(scene, rectangle({-3, 2, -3}, {3, 0, 0}, {0, 0, 6}), diffuse);
  addShape(scene, rectangle({-3, 0, 3}, {6, 0, 0}, {0, 2, 0}), diffuse);
  Rng rng(2);
  for (int i = 0; i < 90; ++i) {
    const Vec3 corner(3 * rng.uniform() - 3, 1.5f + 0.4f * rng.uniform(), 5 * rng.uniform() - 2.5f);
    addEmitter(scene, rectangle(corner, {0.1f, 0, 0}, {0, 0, 0.1f}), 3 + 20 * rng.uniform(), diffuse);
  }
  addEmitter(scene, Sphere{{1.5f, 0.6f, 0}, 0.4f}, 2, diffuse);
  addEmitter(scene, sphereMesh({-2, 0.5f, 1.5f}, 0.3f, 6), 1, diffuse);
  scene.lights.push_back(PointLight{{-1, 1, -2}, grey(1)});
  scene.lights.push_back(SpotLight{{2, 3, 2}, -Vec3::UnitY(), grey(5), 0.5f, 0.3f});
  scene.lights.push_back(DirectionalLight{Vec3(-1, -2, 0.3f).normalized(), grey(1)});
  scene.environment = environment(sunnySky());
  scene.camera.width = scene.camera.height = 24;
  scene.camera.toWorld.topRightCorner<3, 1>() = Vec3(0.2f, 1, -2.9f);
  return scene;
}

const std::vector<LightReceiver> kReceivers{{{0, 0, 0}, Vec3::UnitY()},
                                            {{-2.5f, 0, -1}, Vec3::UnitY()},
                                            {{2, 0.5f, 3}, -Vec3::UnitZ()},
                                            {{-1, 0.8f, 0}, Vec3::Zero()}};

/// The density with which a direction is sampled towards any light, whatever occludes it.
double directionPdf(const RenderScene& scene, const LightSelection& lights, const Vec3& from, const Vec3& wi) {
  double sum = lights.environmentPdf(wi);
  Ray ray{from, wi};
  while (const auto hit = scene.tracer.trace(ray)) {
    sum += lights.pdf(*hit);
    ray = spawnRay(*hit, wi);
  }
  return sum;
}

/// Whether the density of a sample is that of one of the lights in its direction.
bool pdfsAgree(const RenderScene& scene, const LightSelection& lights, const Vec3& from, const LightSample& light) {
  const auto equal = [&](float pdf) { return std::abs(pdf - light.pdf) < 5e-3f * light.pdf; };
  if (!light.source) return equal(lights.environmentPdf(light.wi));
  Ray ray{from, light.wi};
  while (const auto hit = scene.tracer.trace(ray)) {
    if (equal(lights.pdf(*hit))) return true;
    ray = spawnRay(*hit, light.wi);
  }
  return false;
}

/// Tests sampling against the density at all receivers.
void checkDensities(const RenderScene& scene) {
  for (const LightReceiver& at : kReceivers) {
    const LightSelection lights = scene.lights.at(at);
    Rng rng(11);
    const auto draw = [&]() -> std::optional<Vec3> {
      const double choice = rng.uniformDouble();
      const auto light = lights.sample(choice, rng.uniform2());
      if (!light || light->delta) return std::nullopt;
      return light->wi;
    };
    const Chi2Result result = chi2Sphere(draw, [&](const auto& w) {
      return directionPdf(scene, lights, at.position, w.template cast<float>().normalized());
    });
    int differing = 0;
    for (int i = 0; i < 10000; ++i) {
      const double choice = rng.uniformDouble();
      const auto light = lights.sample(choice, rng.uniform2());
      differing += light && !light->delta && !pdfsAgree(scene, lights, at.position, *light);
    }
    CHECK(differing <= 20);  // rays that miss an edge due to rounding
    INFO(at.position.transpose() << ": " << result.message);
    CHECK(result.passed(2 * static_cast<int>(kReceivers.size())));
  }
}

LightCells learnt(const RenderScene& scene, std::uint64_t seed = 1) {
  return learnLightCells(scene, RayCamera(scene.scene.camera, {}), seed);
}

/// A single cell that chooses between all clusters evenly.
LightCells uniformCells(const Lights& lights) {
  const std::vector<float> even(lights.clusters(), 1.0f / static_cast<float>(lights.clusters()));
  return {{{{Vec3::Zero(), Vec3::Zero()}, 0, 0.0f}}, even, [](int, const LightReceiver&) { return 1.0f; }, 1};
}

/// Many small rectangles on a ceiling, facing down.
Scene manyLights(int side) {
  Scene scene;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      const Vec3 corner(static_cast<float>(x), 1, static_cast<float>(y));
      addEmitter(scene, rectangle(corner, {0.1f, 0, 0}, {0, 0, 0.1f}), 1 + static_cast<float>((x * 7 + y * 3) % 5));
    }
  addShape(scene, rectangle({0, 0, 0}, {0, 0, static_cast<float>(side)}, {static_cast<float>(side), 0, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  return scene;
}

}  // namespace

TEST_CASE("render: light samples follow their density at several places, without and with learning", "[heavy]") {
  const Scene scene = litFloor();
  RenderScene ready(scene);
  REQUIRE(ready.lights.clusters() > 100);
  checkDensities(ready);
  ready.lights.use(learnt(ready));
  checkDensities(ready);
}

TEST_CASE("render: each light is chosen with its probability") {
  const Scene scene = litFloor();
  RenderScene ready(scene);
  ready.lights.use(learnt(ready));
  for (const LightReceiver& at : kReceivers) {
    const LightSelection lights = ready.lights.at(at);
    // Area lights have numbers in the order of their shapes; delta lights follow.
    std::vector<double> expected;
    constexpr int kAreaLights = 92;
    const int count = kAreaLights + static_cast<int>(scene.lights.size());
    for (int light = 0; light < count; ++light) expected.push_back(lights.probability(light));
    double sum = std::accumulate(expected.begin(), expected.end(), 0.0);
    double tiles = 0;
    for (int k = 0; k < ready.lights.clusters(); ++k) tiles += lights.clusterProbability(k);
    CHECK(tiles == Approx(1));
    CHECK(sum < 1);
    // Delta lights return the probability of their choice.
    Rng rng(3);
    constexpr int kSamples = 200000;
    std::vector<int> counts(expected.size());
    int wrong = 0;
    for (int i = 0; i < kSamples; ++i) {
      const double choice = rng.uniformDouble();
      const auto light = lights.sample(choice, rng.uniform2());
      if (!light || !light->delta) continue;
      ++counts[light->light];
      wrong += std::abs(light->pdf - expected[light->light]) > 1e-4 * light->pdf;
    }
    CHECK(wrong == 0);
    for (int light = kAreaLights; light < count; ++light) {
      CAPTURE(at.position.transpose(), light);
      const bool shines = illuminate(scene.lights[light - kAreaLights], at.position).has_value();
      const double samples = shines ? expected[light] * kSamples : 0;
      CHECK(std::abs(counts[light] - samples) < kMaxDeviation * std::sqrt(samples) + 1);
    }
  }
}

TEST_CASE("render: the choice in a tree of lights has the stated probabilities, which sum to one") {
  std::vector<LightBounds> bounds;
  Rng rng(5);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p(10 * rng.uniform(), 10 * rng.uniform(), 10 * rng.uniform());
    const Vec3 axis = squareToSphere(rng.uniform2());
    bounds.push_back({{p, p + Vec3::Constant(0.1f)}, axis, i % 3 == 0 ? -1.0f : 1.0f, 0, 1 + 10 * rng.uniform()});
  }
  bounds[7].power = 0;
  const LightTree tree(bounds);
  const std::vector<LightReceiver> receivers{
      {{5, 5, 5}, Vec3::UnitX()}, {{-3, 0, 20}, Vec3::Zero()}, {{0, 0, 0}, Vec3(1, 1, 1).normalized()}};
  for (const LightReceiver& at : receivers) {
    constexpr int kSamples = 100000;
    std::vector<int> counts(bounds.size());
    int none = 0;
    for (int i = 0; i < kSamples; ++i) {
      double choice = rng.uniformDouble();
      const auto chosen = tree.sample(LightTree::kRoot, at, choice);
      if (!chosen) {
        ++none;
        continue;
      }
      ++counts[chosen->light];
      CHECK((choice >= 0 && choice < 1));
      CHECK(chosen->probability == Approx(tree.probability(LightTree::kRoot, at, chosen->light)));
    }
    CHECK(counts[7] == 0);
    double sum = 0, chi2 = 0;
    int bins = 0;
    for (std::size_t light = 0; light < bounds.size(); ++light) {
      if (light == 7) continue;
      const double p = tree.probability(LightTree::kRoot, at, static_cast<int>(light));
      sum += p;
      if (p * kSamples < 5) continue;
      chi2 += std::pow(counts[light] - p * kSamples, 2) / (p * kSamples);
      ++bins;
    }
    CHECK(sum == Approx(1 - static_cast<double>(none) / kSamples).margin(0.01));
    CHECK((chi2 - bins) / std::sqrt(2.0 * bins) < kMaxDeviation);
  }
}

TEST_CASE("render: a tree of lights leaves out only what does not shine on the receiver") {
  Rng rng(9);
  Scene scene;
  for (int i = 0; i < 100; ++i) {
    const Vec3 p(4 * rng.uniform(), 4 * rng.uniform(), 4 * rng.uniform());
    const Vec3 u = squareToSphere(rng.uniform2()) * 0.5f;
    addEmitter(scene, rectangle(p, u, u.unitOrthogonal() * 0.5f), 1 + rng.uniform());
  }
  const RenderScene ready(scene);
  int lit = 0, left = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3 p(6 * rng.uniform() - 1, 6 * rng.uniform() - 1, 6 * rng.uniform() - 1);
    const LightReceiver at{p, squareToSphere(rng.uniform2())};
    const LightSelection oriented = ready.lights.at(at);
    for (int light = 0; light < 100; ++light) {
      const auto& mesh = std::get<TriangleMesh>(scene.shapes[light].geometry);
      bool shines = false;
      for (const Vec3& corner : mesh.positions) {
        const Vec3 to = corner - p;
        const Vec3 normal = pointOnTriangle(mesh, 0, 0, 0).normal;
        shines = shines || (to.dot(at.normal) > 1e-3f && -to.dot(normal) > 1e-3f);
      }
      lit += shines;
      if (shines) CHECK(oriented.probability(light) > 0);
      left += oriented.probability(light) == 0;
    }
  }
  CHECK(lit > 1000);
  CHECK(left > 1000);
}

TEST_CASE("render: lights behind the receiver are not chosen within a cluster, and hardly after learning") {
  std::vector<LightBounds> bounds;
  for (const float y : {1.0f, -1.0f}) bounds.push_back({{Vec3(0, y, 0), Vec3(0.1f, y, 0.1f)}});
  for (LightBounds& b : bounds) b.power = 1;
  const LightTree tree(bounds);
  CHECK(tree.probability(LightTree::kRoot, {{0, 0, 0}, Vec3::UnitY()}, 0) == Approx(1));
  CHECK(tree.probability(LightTree::kRoot, {{0, 0, 0}, Vec3::UnitY()}, 1) == Approx(0).margin(1e-6));
  CHECK(tree.probability(LightTree::kRoot, {{0, 0, 0}, Vec3::Zero()}, 1) == Approx(0.5));

  Scene scene;
  addShape(scene, rectangle({-3, 0, -3}, {0, 0, 6}, {6, 0, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  addEmitter(scene, Sphere{{0, 2, 0}, 0.2f}, 1);
  addEmitter(scene, Sphere{{0, -2, 0}, 0.2f}, 50);
  scene.camera.width = scene.camera.height = 32;
  scene.camera.toWorld.topRightCorner<3, 1>() = Vec3(0, 0.5f, -4);
  RenderScene ready(scene);
  const LightReceiver floor{{0.3f, 0, 0.2f}, Vec3::UnitY()};
  CHECK(ready.lights.at(floor).probability(1) > 0.8f);
  ready.lights.use(learnt(ready));
  CHECK(ready.lights.at(floor).probability(1) < 0.4f);
  CHECK(ready.lights.at(floor).probability(1) > 0.01f);
}

TEST_CASE("render: tiles of the environment have a density that samples follow and that adds up to the plain one") {
  EnvironmentLight light(environment(sunnySky()));
  const EnvironmentLight plain = light;
  light.divide(20);
  REQUIRE(light.tiles() > 10);
  std::vector<double> fractions, uneven;
  double sum = 0;
  for (int i = 0; i < light.tiles(); ++i) {
    fractions.push_back(light.tileFraction(i));
    uneven.push_back(i % 4 == 0 ? 0 : 1 + i);
    sum += uneven.back();
  }
  CHECK(std::accumulate(fractions.begin(), fractions.end(), 0.0) == Approx(1));
  for (double& p : uneven) p /= sum;
  const std::vector<float> same = cumulative(fractions), other = cumulative(uneven);
  const CumulativeProbabilities natural(same.data()), skewed(other.data());
  Rng rng(4);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 w = squareToSphere(rng.uniform2());
    CHECK(light.pdf(w, natural) == Approx(plain.pdf(w)).epsilon(1e-4));
  }
  DiscreteDistribution tiles(uneven);
  const auto draw = [&]() -> std::optional<Vec3> {
    double choice = rng.uniformDouble();
    const auto tile = static_cast<int>(tiles.sample(choice));
    const auto found = light.sample(tile, rng.uniform2(), skewed);
    if (!found) return std::nullopt;
    CHECK(found->pdf == Approx(light.pdf(found->wi, skewed)).epsilon(1e-2));
    return found->wi;
  };
  const Chi2Result result =
      chi2Sphere(draw, [&](const auto& w) { return light.pdf(w.template cast<float>().normalized(), skewed); });
  INFO(result.message);
  CHECK(result.passed());
}

TEST_CASE("render: pictures agree with learnt, prior and uniform choice of lights", "[slow]") {
  const Scene scene = litFloor();
  RenderScene ready(scene);
  const RayCamera camera(scene.camera, {});
  const auto picture = [&](LightCells cells, std::uint64_t seed) {
    ready.lights.use(std::move(cells));
    Film film(camera.width(), camera.height());
    render(camera, PathIntegrator(ready, {}), film, {seed, 512, std::nullopt, PixelSampling::independent});
    return blocks(film, 4);
  };
  const auto even = picture(uniformCells(ready.lights), 1), byPower = picture({}, 2);
  ready.lights.use({});
  const auto byPlace = picture(learnt(ready), 3);
  CHECK(agree(even, byPower));
  CHECK(agree(even, byPlace));
  auto wrong = byPlace;
  for (Block& block : wrong) block.mean *= 1.02;
  CHECK_FALSE(agree(even, wrong));
}

TEST_CASE("render: learnt cells depend on the seed but not on threads") {
  const Scene scene = litFloor();
  const RenderScene ready(scene);
  const auto rows = [&](std::size_t threads, std::uint64_t seed) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    const LightCells cells = learnt(ready, seed);
    std::vector<float> all{static_cast<float>(cells.cells())};
    Rng rng(1);
    for (int i = 0; i < 200; ++i) {
      const Vec3 p(6 * rng.uniform() - 3, 2 * rng.uniform(), 6 * rng.uniform() - 3);
      const float* row = cells.find({p, squareToSphere(rng.uniform2())});
      all.insert(all.end(), row, row + ready.lights.clusters() + 1);
    }
    return all;
  };
  const std::vector<float> one = rows(1, 1);
  CHECK(one[0] > 4);
  CHECK(rows(2, 1) == one);
  CHECK(rows(7, 1) == one);
  CHECK(rows(2, 2) != one);
}

TEST_CASE("render: a scene with a single light learns nothing") {
  Scene scene;
  addShape(scene, rectangle({-3, 0, -3}, {0, 0, 6}, {6, 0, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  addEmitter(scene, Sphere{{0, 2, 0}, 0.2f}, 1);
  CHECK(learnt(RenderScene(scene)).empty());
}

TEST_CASE("render: the choice of lights is learnt behind emitters that the camera does not see") {
  Scene scene;
  scene.emitterVisibility = EmitterVisibility::hidden;
  addShape(scene, rectangle({-3, -3, 4}, {0, 6, 0}, {6, 0, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  addEmitter(scene, rectangle({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}), 1);  // covers the view
  addEmitter(scene, Sphere{{0, 2, 3}, 0.2f}, 1);
  scene.camera.width = scene.camera.height = 32;
  CHECK_FALSE(learnt(RenderScene(scene)).empty());
}

TEST_CASE("render: ten thousand lights are chosen by place") {
  Scene scene = manyLights(100);
  scene.camera.width = scene.camera.height = 64;
  scene.camera.toWorld.topRightCorner<3, 1>() = Vec3(50, 0.5f, 30);
  RenderScene ready(scene);
  const LightReceiver at{{50.3f, 0, 35.7f}, Vec3::UnitY()};
  double truth = 0;
  for (int light = 0; light < 10000; ++light) {
    // The lights are small: the irradiance from their centre.
    const Vec3 to =
        Vec3(0.05f, 0, 0.05f) + std::get<TriangleMesh>(scene.shapes[light].geometry).positions[0] - at.position;
    const float radiance = luminance(scene.shapes[light].emitter->radiance->mean());
    truth += radiance * 0.01 * to.y() * to.y() / std::pow(to.squaredNorm(), 2);
  }
  const auto irradiance = [&] {
    const LightSelection lights = ready.lights.at(at);
    double sum = 0;
    for (int light = 0; light < 10000; ++light) sum += lights.probability(light);
    CHECK(sum == Approx(1).epsilon(1e-4));
    Moments moments;
    Rng rng(3);
    for (int i = 0; i < 40000; ++i) {
      const double choice = rng.uniformDouble();
      const auto light = lights.sample(choice, rng.uniform2());
      moments.add(light ? luminance(light->radiance) * light->wi.y() / light->pdf : 0);
    }
    CHECK(std::abs(moments.mean() - truth) < kMaxDeviation * moments.error() + 0.005 * truth);
    return moments;
  };
  const Moments byPower = irradiance();
  ready.lights.use(learnt(ready));
  const Moments byPlace = irradiance();
  CHECK(byPlace.error() < 0.4 * byPower.error());
  CHECK(byPlace.error() < 0.01 * truth);
}
