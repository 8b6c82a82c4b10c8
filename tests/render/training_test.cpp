// The estimators of training agree: unguided with importance-guided photons, photons with camera paths, and all of them
// with closed forms.

#include <functional>
#include <limits>
#include <vector>

#include "materials/registry.h"
#include "runtime/guiding/field_data.h"
#include "runtime/guiding/sample_storage_data.h"
#include "runtime/render/training/training.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr float kAlbedo = 0.5f;
constexpr int kUnlimited = std::numeric_limits<int>::max();

/// The bin of a particle; negative if none.
using Binning = std::function<int(const Particle&)>;

/// Flux per bin; each photon is one estimate.
std::vector<Moments> photonFlux(const RenderScene& scene, const GuidedSampler& importance, int count,
                                std::uint64_t seed, int bins, const Binning& binOf, int maxDepth = kUnlimited) {
  std::vector<Moments> moments(bins);
  for (int i = 0; i < count; ++i) {
    Sampler rng(seed, 0, i);
    const float choice = rng.uniform();
    const Vec2 u1 = rng.uniform2();
    PhotonResult result;
    if (const auto photon = scene.lights.samplePhoton(choice, u1, rng.uniform2()))
      PhotonWalk(scene, importance, rng, result, maxDepth).run(*photon, static_cast<std::uint64_t>(i));
    std::vector<double> flux(bins);
    for (const Particle& p : dataOf(result.radiance).photons)
      if (const int bin = binOf(p); bin >= 0) flux[bin] += p.weight;
    for (int bin = 0; bin < bins; ++bin) moments[bin].add(flux[bin]);
  }
  return moments;
}

/// A square around the centre of the floor y = 0, lit from above.
struct Patch {
  float half = 0.5f;

  double area() const { return 4.0 * half * half; }
  bool contains(const Particle& p) const {
    return p.normal.y() > 0.99f && p.position.y() < 1e-3f && std::abs(p.position.x()) < half &&
           std::abs(p.position.z()) < half;
  }
  static constexpr int kRings = 3, kSectors = 6;
  /// The bin of the direction: equal areas of the disc.
  int bin(const Particle& p) const {
    if (!contains(p)) return -1;
    const Vec3& w = p.direction;
    const int ring = std::min(static_cast<int>((1 - w.y() * w.y()) * kRings), kRings - 1);
    const float turn = 0.5f + 0.5f * std::atan2(w.z(), w.x()) * kInvPi;
    return ring * kSectors + std::min(static_cast<int>(turn * kSectors), kSectors - 1);
  }
};

/// Flux on the patch per bin from camera paths that start on it: L cosθ divided by the density of the direction, times
/// the area.
std::vector<Moments> pathFlux(const RenderScene& scene, const GuidedSampler& sampler, const Patch& patch, int count,
                              std::uint64_t seed, int maxDepth = kUnlimited) {
  std::vector<Moments> moments(Patch::kRings * Patch::kSectors);
  const ImportonWishes wishes{false, false, true};
  for (int i = 0; i < count; ++i) {
    Sampler rng(seed, 0, i);
    const Vec2 u = patch.half * (2 * rng.uniform2() - Vec2::Ones());
    ImportonResult result;
    ImportonWalk(scene, sampler, wishes, rng, result, maxDepth).run({Vec3(u.x(), 0.01f, u.y()), -Vec3::UnitY()}, 0);
    const std::vector<Particle>& samples = dataOf(result.radiance).samples;
    // Paths may return to the patch, but only first vertices are uniform on it.
    const bool found = !samples.empty() && (samples[0].position - Vec3(u.x(), 0, u.y())).norm() < 1e-4f;
    const int bin = found ? patch.bin(samples[0]) : -1;
    for (int b = 0; b < static_cast<int>(moments.size()); ++b)
      moments[b].add(b == bin ? patch.area() * samples[0].weight : 0);
  }
  return moments;
}

bool agree(const std::vector<Moments>& a, const std::vector<Moments>& b) {
  double worst = 0, sumA = 0, sumB = 0, error2 = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].mean() == b[i].mean()) continue;
    worst = std::max(worst, deviation(a[i], b[i]));
    sumA += a[i].mean();
    sumB += b[i].mean();
    error2 += a[i].error() * a[i].error() + b[i].error() * b[i].error();
  }
  const double together = std::abs(sumA - sumB) / std::sqrt(error2);
  UNSCOPED_INFO("worst " << worst << ", together " << together << ", " << sumA << " and " << sumB << " +- "
                         << std::sqrt(error2));
  return worst < kMaxDeviation && together < kMaxDeviation;
}

BsdfPtr dielectric(const char* type) {
  Parameters parameters;
  parameters.set("int_ior", 1.5);
  parameters.set("ext_ior", 1.0);
  return makeBsdf(type, parameters);
}

/// A room with a lamp that lights only the ceiling, so the floor has no direct light.
Scene roomScene() {
  Scene scene;
  const int wall = addMaterial(scene, std::make_shared<Diffuse>(kAlbedo));
  addShape(scene, box({-2, 0, -2}, {2, 3, 2}, true), wall);
  addEmitter(scene, rectangle({-1.5f, 1.8f, -1.5f}, {0, 0, 1}, {1, 0, 0}), 4, wall);
  return scene;
}

void addMirrorBall(Scene& scene, const Vec3& centre, float radius) {
  addShape(scene, Sphere{centre, radius}, addMaterial(scene, std::make_shared<HalfMirror>(0.4f, 0.5f, 0.5f)));
}

/// A surface of water across the room, with a BSDF of this type.
void addWater(Scene& scene, const char* type) {
  addShape(scene, rectangle({-2, 1, -2}, {0, 0, 4}, {4, 0, 0}), addMaterial(scene, dielectric(type)));
}

/// A sphere of diffuse walls around a point light.
Scene integratingSphere(float radius, float intensity) {
  Scene scene;
  addShape(scene, Sphere{{0, 0, 0}, radius, true}, addMaterial(scene, std::make_shared<Diffuse>(kAlbedo)));
  scene.lights.push_back(PointLight{{0, 0, 0}, grey(intensity)});
  return scene;
}

struct Guides {
  Guides(const RenderScene& scene, const RayCamera& camera)
      : radiance(optionsFor(scene)),
        importance(optionsFor(scene)),
        radianceSampler(scene.scene, radiance, nullptr),
        importanceSampler(scene.scene, importance, nullptr) {
    const ParticleTracer tracer(scene, camera, radianceSampler, importanceSampler, nullptr, 1);
    for (int pass = 0; pass < 3; ++pass) {
      ImportonResult importons = tracer.traceImportons(pass, 8000, {false, true, false});
      PhotonResult photons = tracer.tracePhotons(pass, 10000);
      importons.importance.merge(std::move(photons.importance));
      importance.update(importons.importance);
      importons.radiance.merge(std::move(photons.radiance));
      radiance.update(importons.radiance);
    }
  }
  static FieldOptions optionsFor(const RenderScene& scene) {
    FieldOptions options;
    options.sceneDiagonal = scene.tracer.bounds().diagonal().norm();
    return options;
  }
  Field radiance, importance;
  GuidedSampler radianceSampler, importanceSampler;
};

RayCamera roomCamera() {
  Camera camera;
  camera.width = camera.height = 16;
  camera.horizontalFov = 40;
  // From the ceiling towards the centre of the floor.
  camera.toWorld.block<3, 4>(0, 0) << 1, 0, 0, 0, 0, 0, -1, 2.9f, 0, 1, 0, 0;
  return {camera, {}};
}

struct Unguided {
  explicit Unguided(const Scene& scene) : sampler(scene, nothing, nullptr) {}
  Field nothing;
  GuidedSampler sampler;
};

}  // namespace

TEST_CASE("training: guided photons estimate the same flux as unguided ones with less noise") {
  Scene scene = roomScene();
  addMirrorBall(scene, {0.9f, 0.6f, 0.4f}, 0.5f);
  const RenderScene ready(scene);
  const Guides guides(ready, roomCamera());
  REQUIRE(guides.importance.records() > 30);
  const Unguided unguided(scene);
  const Patch patch{0.3f};
  const auto bin = [&](const Particle& p) { return patch.bin(p); };
  const int bins = Patch::kRings * Patch::kSectors;
  const auto plain = photonFlux(ready, unguided.sampler, 200000, 1, bins, bin);
  const auto guided = photonFlux(ready, guides.importanceSampler, 70000, 2, bins, bin);
  CHECK(agree(plain, guided));
  const auto all = [&](const Particle& p) { return patch.contains(p) ? 0 : -1; };
  const double plainError = photonFlux(ready, unguided.sampler, 60000, 3, 1, all)[0].error();
  const double guidedError = photonFlux(ready, guides.importanceSampler, 60000, 4, 1, all)[0].error();
  CHECK(guidedError < 0.9 * plainError);  // 0.77 in our measurement
}

TEST_CASE("training: camera paths and photons agree on the directional distribution of light", "[heavy]") {
  Scene scene = roomScene();
  SECTION("indirect") {}
  SECTION("via a half mirror") {
    addMirrorBall(scene, {-1.2f, 2.6f, 0.4f}, 0.35f);
  }
  SECTION("with a delta light whose direct part is excluded") {
    scene.lights.push_back(PointLight{{0.5f, 1, 0.2f}, grey(2)});
  }
  SECTION("through smooth water") {
    addWater(scene, "dielectric");
  }
  SECTION("through rough water") {
    addWater(scene, "roughdielectric");
  }
  const RenderScene ready(scene);
  const Unguided unguided(scene);
  const Guides guides(ready, roomCamera());
  REQUIRE(guides.radiance.records() > 30);
  const Patch patch;
  const auto photons = photonFlux(ready, unguided.sampler, 100000, 1, Patch::kRings * Patch::kSectors,
                                  [&](const Particle& p) { return patch.bin(p); });
  CHECK(agree(photons, pathFlux(ready, unguided.sampler, patch, 30000, 2)));
  CHECK(agree(photons, pathFlux(ready, guides.radianceSampler, patch, 30000, 3)));
}

TEST_CASE("training: all estimators agree with the closed form in an integrating sphere") {
  const float radius = 2, intensity = 3;
  const Scene scene = integratingSphere(radius, intensity);
  const RenderScene ready(scene);
  const Unguided unguided(scene);
  // Without direct light, which only next-event estimation samples.
  const double irradiance = intensity / (radius * radius) * kAlbedo / (1 - kAlbedo);
  const double area = 4 * kPi * radius * radius;
  const auto flux = photonFlux(ready, unguided.sampler, 50000, 1, 1, [](const Particle&) { return 0; });
  CHECK(deviation(flux[0], irradiance * area) < kMaxDeviation);
  // Every vertex of every path is an estimate, zero if it has no sample. Only different paths are independent.
  Moments excess;
  for (int i = 0; i < 50000; ++i) {
    Sampler rng(2, 0, i);
    ImportonResult result;
    ImportonWalk(ready, unguided.sampler, {false, false, true}, rng, result).run({Vec3::Zero(), Vec3::UnitX()}, 0);
    double sum = 0;
    for (const Particle& p : dataOf(result.radiance).samples) sum += p.weight;
    excess.add(sum - irradiance * static_cast<double>(dataOf(result.radiance).requests.size()));
  }
  CHECK(std::abs(excess.mean()) < kMaxDeviation * excess.error());
}

TEST_CASE("training: learns the light of the paths of the picture, and not that of longer ones") {
  const float radius = 2, intensity = 3;
  const Scene scene = integratingSphere(radius, intensity);
  const RenderScene ready(scene);
  const Unguided unguided(scene);
  const Ray ray{Vec3::Zero(), Vec3::UnitX()};
  PathOptions options;
  options.maxDepth = GENERATE(1, 2, 3, 5);
  // At the first vertex of the paths, without direct light, which only next-event estimation samples.
  const double direct = options.maxDepth < 2 ? 0 : intensity / (radius * radius);
  double irradiance = 0;
  for (int bounces = 1; bounces <= options.maxDepth - 2; ++bounces) irradiance += direct * std::pow(kAlbedo, bounces);
  CHECK(estimate(PathIntegrator(ready, options), ray, 100).mean() ==
        Approx(kAlbedo * kInvPi * (direct + irradiance)).epsilon(0.01));
  const auto equals = [](const Moments& moments, double expected) {
    UNSCOPED_INFO(moments.mean() << " +- " << moments.error() << ", expected " << expected);
    return std::abs(moments.mean() - expected) <= kMaxDeviation * moments.error();
  };
  const auto flux = photonFlux(
      ready, unguided.sampler, 20000, 1, 1, [](const Particle&) { return 0; }, options.maxDepth);
  CHECK(equals(flux[0], irradiance * 4 * kPi * radius * radius));
  Moments found;
  for (int i = 0; i < 20000; ++i) {
    Sampler rng(2, 0, i);
    ImportonResult result;
    ImportonWalk(ready, unguided.sampler, {false, false, true}, rng, result, options.maxDepth).run(ray, 0);
    double atFirst = 0;
    for (const Particle& p : dataOf(result.radiance).samples)
      if ((p.position - Vec3(radius, 0, 0)).norm() < 1e-3f) atFirst += p.weight;
    found.add(atFirst);
    CHECK(std::ssize(dataOf(result.radiance).requests) < options.maxDepth);
  }
  CHECK(equals(found, irradiance));
}

TEST_CASE("training: camera paths and photons agree on the light of paths of limited length", "[heavy]") {
  Scene scene = roomScene();
  SECTION("of two reflections") {}
  SECTION("via a half mirror") {
    addMirrorBall(scene, {-1.2f, 2.6f, 0.4f}, 0.35f);
  }
  SECTION("through smooth water") {
    addWater(scene, "dielectric");
  }
  const RenderScene ready(scene);
  const Unguided unguided(scene);
  const Patch patch;
  const int maxDepth = 4;
  const auto photons = photonFlux(
      ready, unguided.sampler, 1000000, 1, Patch::kRings * Patch::kSectors,
      [&](const Particle& p) { return patch.bin(p); }, maxDepth);
  CHECK(agree(photons, pathFlux(ready, unguided.sampler, patch, 600000, 2, maxDepth)));
}

TEST_CASE("training: nothing is learnt for pictures of emitters alone") {
  const Scene scene = roomScene();
  const RenderScene ready(scene);
  TrainingPlan plan;
  plan.passes = 1;
  plan.photons = plan.importons = 100;
  plan.maxDepth = 1;
  const TrainedIllumination trained = trainIllumination(ready, roomCamera(), nullptr, plan);
  CHECK(trained.report.particles() == 0);
  CHECK(trained.field.records() == 0);
}

namespace {

/// Reports an albedo of 1 whatever the true albedo, so that particles survive with any weight.
class FullAlbedoDiffuse : public Diffuse {
 public:
  using Diffuse::Diffuse;
  Rgb albedo(const Vec3&, const Vec2&) const override { return grey(1.0f); }
};

/// Flux reflected by a floor of this albedo and then by the five walls, divided by the albedo and by the flux that the
/// floor receives.
Moments fluxFromFloor(float albedo, float walls) {
  Scene scene;
  addShape(scene, box({-1, -1, -1}, {1, 1, 1}, true), addMaterial(scene, std::make_shared<Diffuse>(walls)));
  const int floor = addMaterial(scene, std::make_shared<FullAlbedoDiffuse>(albedo));
  addShape(scene, rectangle({-1, -0.99f, -1}, {0, 0, 2}, {2, 0, 0}), floor);
  const double cap = 2 * kPi * (1 - std::cos(0.5));  // solid angle of the cone
  const float intensity = static_cast<float>(1 / (cap * albedo));
  scene.lights.push_back(SpotLight{{0, 0, 0}, -Vec3::UnitY(), grey(intensity), 0.5f, 0.5f});
  const RenderScene ready(scene);
  const Unguided unguided(scene);
  return photonFlux(ready, unguided.sampler, 20000, 1, 1, [](const Particle&) { return 0; })[0];
}

}  // namespace

TEST_CASE("training: the weight window is unbiased for particles of any weight") {
  for (const float albedo : {40.0f, 3.0f, 0.5f, 1e-4f, 1e-8f}) {
    const Moments flux = fluxFromFloor(albedo, 0);
    INFO("albedo " << albedo << ": " << flux.mean() << " +- " << flux.error());
    CHECK(deviation(flux, 1) < kMaxDeviation);
  }
  // With an albedo of 1e-8 only about one photon in a hundred survives the first wall.
  const Moments kept = fluxFromFloor(1e-4f, kAlbedo), ended = fluxFromFloor(1e-8f, kAlbedo);
  INFO(kept.mean() << " +- " << kept.error() << ", " << ended.mean() << " +- " << ended.error());
  CHECK(kept.mean() > 1.5);
  CHECK(deviation(kept, ended) < kMaxDeviation);
}

TEST_CASE("training: photons that gain light at every bounce need bounded memory and lose no light") {
  const float albedo = 1.5f, intensity = 3;
  Scene scene;
  addShape(scene, box({-2, -2, -2}, {2, 2, 2}, true), addMaterial(scene, std::make_shared<Diffuse>(albedo)));
  scene.lights.push_back(PointLight{{0, 0, 0}, grey(intensity)});
  const RenderScene ready(scene);
  const Unguided unguided(scene);
  const RayCamera camera = roomCamera();
  const ParticleTracer tracer(ready, camera, unguided.sampler, unguided.sampler, nullptr, 1);
  const int photons = 1000;
  const PhotonResult result = tracer.tracePhotons(0, photons);
  const std::vector<Particle>& particles = dataOf(result.radiance).photons;
  CHECK(std::ssize(particles) < 128 * photons);
  // All light is reflected until the longest paths end. Its direct part is not stored.
  double flux = 0, expected = 0;
  for (const Particle& p : particles) flux += p.weight / photons;
  for (int bounces = 1; bounces < kMaxTrainingDepth; ++bounces)
    expected += 4 * kPi * intensity * std::pow(albedo, bounces);
  CHECK(flux == Approx(expected).epsilon(0.01));
}

TEST_CASE("training: records serve what the camera sees through hidden emitters") {
  Scene scene;
  scene.emitterVisibility = EmitterVisibility::hidden;
  const int wall = addMaterial(scene, std::make_shared<Diffuse>(kAlbedo));
  addShape(scene, rectangle({-3, -3, 4}, {0, 6, 0}, {6, 0, 0}), wall);
  // A lamp that faces the wall and covers the view.
  addEmitter(scene, rectangle({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}), 1,
             addMaterial(scene, std::make_shared<Diffuse>(0.0f)));
  scene.camera.width = scene.camera.height = 16;
  TrainingPlan plan;
  plan.passes = 1;
  plan.photons = plan.importons = 2000;
  const RenderScene ready(scene);
  const Field field = trainIllumination(ready, RayCamera(scene.camera, {}), nullptr, plan).field;
  int served = 0;
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 10; ++x) {
      const Vec3 seen(0.3f * static_cast<float>(x) - 1.35f, 0.3f * static_cast<float>(y) - 1.35f, 4);
      served += cacheOf(field).find(seen, -Vec3::UnitZ()) != nullptr;
    }
  CHECK(served > 50);
}
