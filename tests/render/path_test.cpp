// Integrators compared with closed forms and with each other.

#include <cstring>
#include <limits>

#include <oneapi/tbb/global_control.h>

#include "runtime/render/integrators/renderer.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr float kAlbedo = 0.6f;

// A floor that faces +y; rays look at its centre, the origin.
Scene floorScene() {
  Scene scene;
  addShape(scene, rectangle({-50, 0, -50}, {0, 0, 100}, {100, 0, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(kAlbedo)));
  return scene;
}
const Ray kLookAtOrigin{Vec3(0.5f, 0.5f, 0), Vec3(-1, -1, 0).normalized()};

Moments directLight(const Scene& scene) {
  const RenderScene ready(scene);
  return estimate(PathIntegrator(ready, {2}), kLookAtOrigin, 40000);
}

double deviationOfDirect(const Scene& scene, double truth) {
  return deviation(directLight(scene), truth);
}

// Form factor of an a×b rectangle at height 1, from a point below one of its corners.
double cornerFactor(double a, double b) {
  const double p = std::sqrt(1 + a * a), q = std::sqrt(1 + b * b);
  return (a / p * std::atan(b / p) + b / q * std::atan(a / q)) / (2 * kPi);
}

}  // namespace

TEST_CASE("render: direct light agrees with closed forms") {
  Scene scene = floorScene();
  SECTION("rectangle") {
    addEmitter(scene, rectangle({-1, 1, -2}, {2, 0, 0}, {0, 0, 4}), 3);
    CHECK(deviationOfDirect(scene, kAlbedo * 3 * 4 * cornerFactor(1, 2)) < kMaxDeviation);
  }
  SECTION("rectangle that faces away") {
    addEmitter(scene, rectangle({-1, 1, -2}, {0, 0, 4}, {2, 0, 0}), 3);
    CHECK(directLight(scene).mean() == 0);
  }
  SECTION("disk") {
    addEmitter(scene, Disk{{0, 2, 0}, {1.5f, 0, 0}, {0, 0, 1.5f}}, 3);
    CHECK(deviationOfDirect(scene, kAlbedo * 3 * 2.25 / (2.25 + 4)) < kMaxDeviation);
  }
  SECTION("sphere") {
    const Vec3 centre(2, 3, 1);
    addEmitter(scene, Sphere{centre, 1.2f}, 3);
    const double d2 = centre.squaredNorm();
    CHECK(deviationOfDirect(scene, kAlbedo * 3 * 1.44 / d2 * 3 / std::sqrt(d2)) < kMaxDeviation);
  }
  SECTION("cylinder around") {
    addEmitter(scene, Cylinder{{0, 0, 0}, {0, 0, 1.5f}, {1.5f, 0, 0}, {0, 2, 0}, true}, 3);
    CHECK(deviationOfDirect(scene, kAlbedo * 3 * 4 / (2.25 + 4)) < kMaxDeviation);  // all but the open end
  }
  SECTION("sphere, tiny and far") {
    const Vec3 centre(200, 300, 100);
    addEmitter(scene, Sphere{centre, 0.01f}, 1e8f);
    const double d2 = centre.squaredNorm();
    CHECK(deviationOfDirect(scene, kAlbedo * 1e8 * 1e-4 / d2 * 300 / std::sqrt(d2)) < kMaxDeviation);
  }
  SECTION("constant environment") {
    scene.environment = environment(Image(1, 1, grey(3)));
    CHECK(deviationOfDirect(scene, kAlbedo * 3) < kMaxDeviation);
  }
  SECTION("point") {
    scene.lights.push_back(PointLight{{1, 2, -1}, grey(3)});
    CHECK(directLight(scene).mean() == Approx(kAlbedo / kPi * 3 * 2 / std::pow(6, 1.5)).epsilon(1e-5));
  }
  SECTION("point below the floor") {
    scene.lights.push_back(PointLight{{1, -2, -1}, grey(3)});
    CHECK(directLight(scene).mean() == 0);
  }
  SECTION("point behind a screen") {
    scene.lights.push_back(PointLight{{1, 2, -1}, grey(3)});
    addShape(scene, Sphere{{0.75f, 1.5f, -0.75f}, 0.01f}, -1);
    CHECK(directLight(scene).mean() == 0);
    std::get<PointLight>(scene.lights[0]).position *= 0.5f;  // in front of it
    CHECK(directLight(scene).mean() == Approx(kAlbedo / kPi * 4 * 3 * 2 / std::pow(6, 1.5)).epsilon(1e-5));
  }
  SECTION("spot") {
    // The origin is seen at 30° from the axis, halfway between beam width and cutoff.
    const float angle = kPi / 6;
    scene.lights.push_back(
        SpotLight{{0, 2, 0}, {std::sin(angle), -std::cos(angle), 0}, grey(3), kPi / 5, kPi * 2 / 15});
    CHECK(directLight(scene).mean() == Approx(0.5 * kAlbedo / kPi * 3 / 4).epsilon(1e-5));
    auto& spot = std::get<SpotLight>(scene.lights[0]);
    spot.direction = {0, -1, 0};
    CHECK(directLight(scene).mean() == Approx(kAlbedo / kPi * 3 / 4).epsilon(1e-5));
    spot.direction = {0, 1, 0};
    CHECK(directLight(scene).mean() == 0);
  }
  SECTION("directional") {
    scene.lights.push_back(DirectionalLight{Vec3(2, -1, 2) / 3, grey(3)});
    CHECK(directLight(scene).mean() == Approx(kAlbedo / kPi * 3 / 3).epsilon(1e-5));
  }
  SECTION("delta lights together with area lights") {
    addEmitter(scene, rectangle({-1, 1, -2}, {2, 0, 0}, {0, 0, 4}), 3);
    scene.lights.push_back(PointLight{{0, 0.5f, 0}, grey(2)});
    scene.lights.push_back(DirectionalLight{Vec3(3, -4, 0) / 5, grey(1)});
    const double truth =
        kAlbedo * (3 * 4 * cornerFactor(1, 2) + 2 / (0.25 * kPi));  // the rectangle shades the parallel light
    CHECK(deviationOfDirect(scene, truth) < kMaxDeviation);
  }
  SECTION("several at once") {
    addEmitter(scene, rectangle({-1, 1, -2}, {2, 0, 0}, {0, 0, 4}), 3);
    scene.environment = environment(Image(1, 1, grey(2)));
    const double fraction = 4 * cornerFactor(1, 2);
    CHECK(deviationOfDirect(scene, kAlbedo * (3 * fraction + 2 * (1 - fraction))) < kMaxDeviation);
  }
}

TEST_CASE("render: the radiance in a furnace is emission over one minus albedo") {
  const float emission = 0.5f;
  Scene scene;
  const int material = addMaterial(scene, std::make_shared<Diffuse>(kAlbedo));
  SECTION("sphere") {
    addEmitter(scene, Sphere{{1, 2, 3}, 2.0f, true}, emission, material);
  }
  SECTION("box") {
    addEmitter(scene, box({0, 1, 2}, {2, 3, 4}, true), emission, material);
  }
  SECTION("half mirror") {
    const int mirror = addMaterial(scene, std::make_shared<HalfMirror>(0.4f, 0.2f, 0.3f));
    addEmitter(scene, box({0, 1, 2}, {2, 3, 4}, true), emission, mirror);
  }
  SECTION("cylinder") {
    addEmitter(scene, Cylinder{{1, 2, 2}, {1, 0, 0}, {0, 1, 0}, {0, 0, 2}, true}, emission, material);
    addEmitter(scene, Disk{{1, 2, 2}, {1, 0, 0}, {0, 1, 0}}, emission, material);
    addEmitter(scene, Disk{{1, 2, 4}, {1, 0, 0}, {0, 1, 0}, true}, emission, material);
  }
  const RenderScene ready(scene);
  const Ray ray{Vec3(1, 2, 3), Vec3(1, 2, -1.5f).normalized()};
  CHECK(deviation(estimate(PathIntegrator(ready, {}), ray, 20000), emission / (1 - kAlbedo)) < kMaxDeviation);
}

TEST_CASE("render: directions on different sides of the two normals are black") {
  Scene scene;
  TriangleMesh floor = rectangle({-50, 0, -50}, {0, 0, 100}, {100, 0, 0});
  floor.normals.assign(4, Vec3(0.8f, 0.6f, 0));
  addShape(scene, floor, addMaterial(scene, std::make_shared<Diffuse>(kAlbedo)));
  addEmitter(scene, Sphere{{0, -3, 0}, 1}, 1);  // under the floor
  const RenderScene ready(scene);
  const auto seenFrom = [&](const Vec3& eye) {
    return estimate(PathIntegrator(ready, {2}), {eye, (-eye).normalized()}, 1000).mean();
  };
  CHECK(seenFrom({-5, 1, 0}) == 0);  // above the floor, below the shading normal's horizon
  CHECK(seenFrom({5, 1, 0}) == 0);   // above both
  CHECK(seenFrom({-5, -5, 0}) > 0);  // below both
}

TEST_CASE("render: the maximum depth counts path segments") {
  Scene scene;
  addEmitter(scene, Sphere{{0, 0, 0}, 2.0f, true}, 1, addMaterial(scene, std::make_shared<Diffuse>(kAlbedo)));
  const RenderScene ready(scene);
  double truth = 0;
  for (const int depth : {1, 2, 3, 4}) {
    truth += std::pow(kAlbedo, depth - 1);
    CHECK(deviation(estimate(PathIntegrator(ready, {depth}), {Vec3(0, 0, 0), Vec3(0, 0, 1)}, 20000), truth) <
          kMaxDeviation);
  }
}

namespace {

// Lights of several sizes in a room with a half mirror, so that every sampling technique matters somewhere.
Scene roomScene() {
  Scene scene;
  const int wall = addMaterial(scene, std::make_shared<Diffuse>(kAlbedo));
  const int mirror = addMaterial(scene, std::make_shared<HalfMirror>(0.3f, 0.4f, 0.5f));
  addShape(scene, box({-2, 0, -2}, {2, 3, 2}, true), wall);
  addShape(scene, Sphere{{0.8f, 0.7f, 0}, 0.6f}, mirror);
  addShape(scene, sphereMesh({-0.6f, 0.8f, 0.4f}, 0.5f, 3), wall);  // shading normals far from the geometry's
  addShape(scene, Disk{{-1, 0.01f, 0}, {0.5f, 0, 0}, {0, 0, -0.5f}}, mirror);
  addEmitter(scene, rectangle({-0.5f, 2.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}), 4, wall);
  addEmitter(scene, Sphere{{-1, 1, 1}, 0.1f}, 20, wall);
  return scene;
}
const Ray kLookIntoRoom{Vec3(-1.5f, 1.5f, -1.5f), Vec3(1.8f, -1.0f, 1.4f).normalized()};

// A reference path tracer with BSDF sampling only.
class Naive : public Integrator {
 public:
  explicit Naive(const RenderScene& scene) : scene_(scene) {}
  Rgb radiance(const Ray& first, Sampler& rng, PathStatistics&) const override {
    Rgb sum = Rgb::Zero(), throughput = Rgb::Ones();
    Ray ray = first;
    while (const auto hit = scene_.tracer.trace(ray)) {
      sum += throughput * emittedRadiance(*hit);
      if (!sidesAgree(*hit, hit->woWorld, hit->wo)) return sum;
      const auto step = next(*hit, rng);
      if (!step || rng.uniform() > 0.8f) return sum;
      throughput *= step->second / 0.8f;
      ray = spawnRay(*hit, hit->frame.toWorld(step->first));
      if (!sidesAgree(*hit, ray.direction, step->first)) return sum;
    }
    return sum;
  }

 private:
  static std::optional<std::pair<Vec3, Rgb>> next(const SurfaceHit& hit, Sampler& rng) {
    const float fraction = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    if (rng.uniform() < fraction) {
      const auto s = hit.bsdf->sampleDelta(hit.wo, hit.uv, rng.uniform());
      return s ? std::optional(std::pair(s->wi, Rgb(s->weight / fraction))) : std::nullopt;
    }
    const float choice = rng.uniform();
    const auto s = hit.bsdf->sample(hit.wo, hit.uv, choice, rng.uniform2());
    if (!s) return std::nullopt;
    return std::pair(s->wi, Rgb(s->f * std::abs(s->wi.z()) / (s->pdf * (1 - fraction))));
  }
  const RenderScene& scene_;
};

// Samples uniform directions and reports a density that is wrong by the factor `fault`.
struct UniformSampler {
  float fault = 1;
  class Vertex {
   public:
    Vertex(const UniformSampler& sampler, const SurfaceHit& hit) : density_(0.5f * kInvPi * sampler.fault), hit_(hit) {}
    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics&) const {
      Vec3 wi = squareToSphere(rng.uniform2());
      if (wi.z() * hit_.wo.z() < 0) wi.z() = -wi.z();
      return BsdfSample{wi, hit_.bsdf->eval(hit_.wo, wi, hit_.uv), density_};
    }
    float pdf(const Vec3& wi) const { return wi.z() * hit_.wo.z() > 0 ? density_ : 0; }
    // A wildly wrong but deterministic estimate, which controls splitting and Russian roulette.
    std::optional<VertexEstimate> estimate() const {
      const float wild = std::sin(100 * hit_.position.sum());
      return wild > 0 ? std::optional(VertexEstimate{std::exp(4 * wild), wild > 0.5f ? 1u : 0u}) : std::nullopt;
    }

   private:
    float density_;
    const SurfaceHit& hit_;
  };
};

/// BSDF sampling, with the same estimate at all vertices.
struct EstimatingSampler : BsdfSampler {
  class Vertex : public BsdfSampler::Vertex {
   public:
    using BsdfSampler::Vertex::Vertex;
    static std::optional<VertexEstimate> estimate() { return VertexEstimate{1, 0}; }
  };
};

class UniformIntegrator : public Integrator {
 public:
  UniformIntegrator(const RenderScene& scene, float fault, const SampleCountModel* counts = nullptr)
      : scene_(scene), sampler_{fault} {
    options_.counts = counts;
  }
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const override {
    return PathLoop(scene_, options_, sampler_).radiance(ray, rng, statistics);
  }

 private:
  const RenderScene& scene_;
  PathOptions options_;
  UniformSampler sampler_;
};

}  // namespace

TEST_CASE("render: all sampling techniques estimate the same radiance") {
  const Scene scene = roomScene();
  const RenderScene ready(scene);
  const Moments path = estimate(PathIntegrator(ready, {}), kLookIntoRoom, 100000);
  CHECK(path.error() < 0.01 * path.mean());
  CHECK(deviation(path, estimate(Naive(ready), kLookIntoRoom, 400000, 8)) < kMaxDeviation);
  CHECK(deviation(path, estimate(UniformIntegrator(ready, 1.0f), kLookIntoRoom, 100000, 9)) < kMaxDeviation);
  // A density that is off by a tenth must not pass.
  CHECK(deviation(path, estimate(UniformIntegrator(ready, 1.1f), kLookIntoRoom, 100000, 9)) > kMaxDeviation);
}

TEST_CASE("render: estimates are unbiased for any counts of samples") {
  const Scene scene = roomScene();
  const RenderScene ready(scene);
  const Moments path = estimate(PathIntegrator(ready, {}), kLookIntoRoom, 100000);
  // The paths of record 0 find all light in their continuation, with much noise; those of record 1 by next-event
  // estimation.
  PathLog log;
  for (int i = 0; i < 100; ++i) {
    const bool bright = i % 10 == 0;
    log.vertices.push_back({{1, 0}, 1, 0, 0, 0, 1});
    log.paths.push_back({log.vertices.size(), bright ? 8.0f : 0.0f, 2});
    log.vertices.push_back({{1, 1}, 1, 0, bright ? 8.0f : 0.0f, 0, 1});
    log.paths.push_back({log.vertices.size(), bright ? 8.0f : 0.0f, 2});
  }
  const SampleCountModel counts(log, 2);
  CHECK(counts.counts(0, 2).continued > 1);
  CHECK(counts.counts(0, 2).direct < counts.counts(1, 2).direct);
  CHECK(counts.counts(1, 0.3f).continued < 1);
  const UniformIntegrator counting(ready, 1.0f, &counts);
  CHECK(deviation(path, estimate(counting, kLookIntoRoom, 100000, 9)) < kMaxDeviation);
  PathStatistics plain, split;
  Sampler rng(3);
  for (int i = 0; i < 1000; ++i) {
    UniformIntegrator(ready, 1.0f).radiance(kLookIntoRoom, rng, plain);
    counting.radiance(kLookIntoRoom, rng, split);
  }
  CHECK(split.segments > 1.3 * plain.segments);
}

TEST_CASE("render: paths without a finite value do not disturb the learning of counts") {
  // In a closed box whose walls reflect twice the light, a few paths in a thousand exceed the range of single
  // precision.
  Scene scene;
  addEmitter(scene, box({-1, -1, -1}, {1, 1, 1}, true), 0.5f, addMaterial(scene, std::make_shared<Diffuse>(2.0f)));
  const RenderScene ready(scene);
  const PathOptions options;
  const EstimatingSampler sampler;
  const PathLoop loop(ready, options, sampler);
  const Ray inside{Vec3(0, 0, 0), Vec3(0.6f, 0.8f, 0)};
  PathLog log;
  PathStatistics statistics;
  Sampler rng(3);
  int invalid = 0;
  for (int i = 0; i < 5000; ++i) {
    loop.log(inside, rng, log);
    if (!loop.radiance(inside, rng, statistics).isFinite().all()) ++invalid;
  }
  REQUIRE(invalid > 0);
  CHECK(log.paths.size() > 4000);
  CHECK(log.paths.size() < 5000);
  CHECK(std::ranges::all_of(log.paths, [](const PathLog::Path& path) { return std::isfinite(path.radiance); }));
  CHECK(!log.vertices.empty());
  CHECK(log.vertices.size() == log.paths.back().end);
}

TEST_CASE("render: an image depends on the seed but not on threads or waves") {
  Scene scene = roomScene();
  const RenderScene ready(scene);
  Camera camera;
  camera.width = 37, camera.height = 21;
  camera.toWorld.topRightCorner<3, 1>() = Vec3(0, 1.5f, -1.9f);
  const RayCamera pinhole(camera, {});
  const PathIntegrator integrator(ready, {});
  const auto image = [&](int threads, std::uint64_t seed) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    Film film(camera.width, camera.height);
    RenderOptions options;
    options.seed = seed, options.samples = 7;
    const RenderResult result = render(pinhole, integrator, film, options);
    CHECK(result.total.samples == 7);
    CHECK(result.statistics.paths == 7u * 37 * 21);
    CHECK(film.dropped() == 0);
    return film.mean();
  };
  const auto equal = [](const Image& a, const Image& b) {
    return std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Rgb)) == 0;
  };
  const Image one = image(1, 5);
  // Sample s of pixel i has its own random numbers, which do not depend on the wave.
  Film byHand(camera.width, camera.height);
  PathStatistics statistics;
  for (int s = 0; s < 7; ++s) {
    Sampler rng = Sampler::stratified(5, 11 * camera.width + 13, static_cast<std::uint32_t>(s));
    const Ray ray = pinhole.sample(13, 11, rng);
    byHand.add(13, 11, integrator.radiance(ray, rng, statistics));
  }
  CHECK((byHand.mean().at(13, 11) == one.at(13, 11)).all());
  CHECK(equal(one, image(2, 5)));
  CHECK_FALSE(equal(one, image(1, 6)));
}

namespace {

/// Sets the flag after a number of samples, like a signal at a random moment.
class StoppingIntegrator : public Integrator {
 public:
  StoppingIntegrator(const Integrator& inner, int samples, StopFlag& flag)
      : inner_(inner), left_(samples), flag_(flag) {}
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const override {
    if (--left_ == 0) flag_ = 1;
    return inner_.radiance(ray, rng, statistics);
  }

 private:
  const Integrator& inner_;
  mutable std::atomic<int> left_;
  StopFlag& flag_;
};

bool sameFilm(const Film& a, const Film& b) {
  return std::ranges::equal(a.pixels(), b.pixels(), [](const Film::Pixel& p, const Film::Pixel& q) {
    return std::ranges::equal(p.sum, q.sum) && std::ranges::equal(p.squares, q.squares) && p.count == q.count &&
           p.dropped == q.dropped;
  });
}

}  // namespace

TEST_CASE("render: stopped at any moment and continued, an image has the same bytes") {
  const Scene scene = roomScene();
  const RenderScene ready(scene);
  Camera camera;
  camera.width = 50, camera.height = 40;
  camera.toWorld.topRightCorner<3, 1>() = Vec3(0, 1.5f, -1.9f);
  const RayCamera pinhole(camera, {});
  const PathIntegrator integrator(ready, {});
  RenderOptions options;
  options.samples = 9, options.firstSample = 3;
  Film whole(camera.width, camera.height);
  const RenderResult uninterrupted = render(pinhole, integrator, whole, options);
  CHECK_FALSE(uninterrupted.stopped);
  int uneven = 0;
  for (const int moment : {1, 700, 2001, 5000, 9100, 13000, 17999}) {
    StopFlag stop = 0;
    options.stop = &stop;
    Film film(camera.width, camera.height);
    const RenderResult part = render(pinhole, StoppingIntegrator(integrator, moment, stop), film, options);
    const auto [least, most] = film.sampleRange();
    uneven += least < most;
    CHECK(part.total.samples == static_cast<int>(least));
    stop = 0;
    const RenderResult result = render(pinhole, integrator, film, options, {}, part);
    CHECK_FALSE(result.stopped);
    CHECK(result.total.samples == 9);
    CHECK(result.statistics.paths == uninterrupted.statistics.paths);
    CHECK(result.statistics.rays() == uninterrupted.statistics.rays());
    CHECK(sameFilm(film, whole));
  }
  CHECK(uneven > 2);
}

TEST_CASE("render: an integrator that fails ends rendering with its error") {
  const Scene scene = roomScene();
  const RenderScene ready(scene);
  Camera camera;
  camera.width = 50, camera.height = 40;
  struct Failing : Integrator {
    mutable std::atomic<int> left = 3000;
    Rgb radiance(const Ray&, Sampler&, PathStatistics&) const override {
      if (--left == 0) throw std::runtime_error("injected");
      return Rgb::Zero();
    }
  };
  Film film(camera.width, camera.height);
  RenderOptions options;
  options.samples = 5;
  CHECK_THROWS_WITH(render(RayCamera(camera, {}), Failing(), film, options), "injected");
}

TEST_CASE("render: the time limit ends a render after whole samples") {
  Scene scene = roomScene();
  const RenderScene ready(scene);
  Camera camera;
  camera.width = 64, camera.height = 48;
  camera.toWorld.topRightCorner<3, 1>() = Vec3(0, 1.5f, -1.9f);
  Film film(camera.width, camera.height);
  RenderOptions options;
  options.seconds = 0.3;
  const RenderResult result = render(RayCamera(camera, {}), PathIntegrator(ready, {}), film, options);
  CHECK(result.total.samples >= 1);
  // Without a limit of the samples, the time has ended the rendering; what is there are whole samples.
  options.seconds.reset();
  options.samples = result.total.samples;
  Film same(camera.width, camera.height);
  render(RayCamera(camera, {}), PathIntegrator(ready, {}), same, options);
  CHECK(sameFilm(same, film));
}

TEST_CASE("render: a timed render ends where the numbers of samples end") {
  constexpr int kMost = std::numeric_limits<int>::max(), kFirst = 5, kLeft = 3;
  Film::Pixel pixel;
  pixel.count = kMost - kFirst - kLeft;
  Film film(1, 1, {pixel});
  Camera camera;
  camera.width = camera.height = 1;
  RenderOptions options;
  options.seconds = 0.5;
  options.firstSample = kFirst;
  int samples = 0;
  const AddSample addSample = [&](int x, int y, Sampler&, PathStatistics&) {
    film.add(x, y, Rgb::Ones());
    ++samples;
  };
  const RenderResult result = render(RayCamera(camera, {}), addSample, film, options);
  CHECK(samples == kLeft);
  CHECK(result.total.samples == kMost - kFirst);
  CHECK(result.total.seconds < 0.5);
  CHECK_FALSE(result.stopped);
}

TEST_CASE("render: invalid render options are errors") {
  RenderOptions options;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("samples"));
  options.samples = 0;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("samples per pixel: 0"));
  options.samples.reset();
  options.seconds = -1;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("seconds"));
}
