// The incident-radiance reference for grading trained illumination, compared with closed forms.

#include <cmath>
#include <vector>

#include "runtime/analysis/incident_radiance.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

double cosinePdf(const Vec3& wi) {
  return cosineHemispherePdf(wi);
}
double uniformPdf(const Vec3&) {
  return 0.5 * kInvPi;
}

/// f = cosθ in uniform directions; each estimate is randomly 0 or 2 f.
IncidentRadiance noisyCosine(int count) {
  std::vector<IncidentRadiance::Sample> samples;
  Rng rng(3);
  for (int i = 0; i < count; ++i) {
    Vec3 wi = squareToSphere(rng.uniform2());
    wi.z() = std::abs(wi.z());
    const auto noisy = [&] { return rng.uniform() < 0.5f ? 0.0 : 2.0 * wi.z(); };
    const double first = noisy();
    samples.push_back({wi, count * uniformPdf(wi), first, noisy(), i % 2 == 0});
  }
  return IncidentRadiance(std::move(samples));
}

Receiver upward() {
  return {{Vec3::Zero(), Vec3::UnitZ(), Vec2::Zero(), 1e-5f}, Vec3::UnitZ()};
}

Particle particle(const Vec3& position, const Vec3& normal, const Vec3& direction, float weight) {
  return {position, normal, direction.normalized(), weight, 1.0f};
}

}  // namespace

TEST_CASE("render: the relative variance excludes the noise of the radiance estimates") {
  const IncidentRadiance light = noisyCosine(200000);
  CHECK(light.irradiance() == Approx(kPi).epsilon(0.02));
  // ∫ cos² / p over π²: 1 for p = cos/π, 4/3 for p = 1/2π.
  CHECK(*light.nev(cosinePdf) == Approx(0).margin(0.03));
  CHECK(*light.nev(uniformPdf) == Approx(1.0 / 3).margin(0.03));
  CHECK(std::isinf(*light.nev([](const Vec3&) { return 0.0; })));
  CHECK_FALSE(IncidentRadiance(std::vector<IncidentRadiance::Sample>{}).nev(cosinePdf));
}

TEST_CASE("render: the incident-radiance reference excludes the part of next-event estimation") {
  Scene scene;
  scene.environment = environment(Image(1, 1, grey(2)));
  addShape(scene, rectangle({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  const RenderScene ready(scene);
  const IlluminationCache nothing;
  const ServedDensity density(nothing, upward());
  CHECK(density.record() == nullptr);
  CHECK(density.mixture(Vec3::UnitZ()) == Approx(kInvPi));
  const IncidentRadiance light(ready, PathIntegrator(ready, {}), upward(), density, {}, 0);
  // The multiple importance weight is 1/(1 + (1/4π ÷ cosθ/π)²): 2 · 2π ∫ c / (1 + 1/16c²) dc.
  CHECK(light.irradiance() == Approx(2 * 2 * kPi * (0.5 - std::log(17.0) / 32)).epsilon(0.01));
}

TEST_CASE("render: receivers are found through mirrors and not where rays escape") {
  Scene scene;
  const int mirror = addMaterial(scene, std::make_shared<HalfMirror>(0.5f, 1.0f, 1.0f));
  const int diffuse = addMaterial(scene, std::make_shared<Diffuse>(0.5f));
  addShape(scene, rectangle({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}), mirror);
  addShape(scene, rectangle({-5, -5, 3}, {10, 0, 0}, {0, 10, 0}), diffuse);  // seen from its back
  const RenderScene ready(scene);
  const std::optional<Receiver> found = firstReceiver(ready, {{0, 0, 1}, -Vec3::UnitZ()});
  REQUIRE(found);
  CHECK((found->point.position - Vec3(0, 0, 3)).norm() < 1e-4f);
  CHECK((found->normal + Vec3::UnitZ()).norm() < 1e-5f);
  CHECK_FALSE(firstReceiver(ready, {{0, 0, 4}, Vec3::UnitZ()}));
}

TEST_CASE("render: receivers are found behind emitters that the camera does not see") {
  Scene scene;
  const int diffuse = addMaterial(scene, std::make_shared<Diffuse>(0.5f));
  addShape(scene, rectangle({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}), diffuse);
  addEmitter(scene, rectangle({-5, -5, 1}, {0, 10, 0}, {10, 0, 0}), 1, diffuse);
  const auto found = [&](EmitterVisibility visibility) {
    scene.emitterVisibility = visibility;
    return firstReceiver(RenderScene(scene), {{0, 0, 2}, -Vec3::UnitZ()});
  };
  REQUIRE((found(EmitterVisibility::dark) && found(EmitterVisibility::hidden)));
  CHECK(found(EmitterVisibility::dark)->point.position.z() == Approx(1));
  CHECK(found(EmitterVisibility::hidden)->point.position.z() == Approx(0).margin(1e-5));
}

TEST_CASE("render: held-out particles are selected as for training a record") {
  const Vec3 up = Vec3::UnitZ();
  const std::vector<Particle> particles{
      particle({0.3f, 0, 0}, up, up, 1),          // third
      particle({0.1f, 0, 0}, up, up, 1),          // nearest
      particle({0.2f, 0, 0}, up, {1, 0, 1}, 3),   // second
      particle({0, 0, 0}, Vec3::UnitX(), up, 1),  // different normal
      particle({0, 0, 0}, up, {1, 0, -0.1f}, 1),  // from below
      particle({2, 0, 0}, up, up, 1),             // too far
  };
  CHECK(particlesAround(upward(), particles, 10, 1).size() == 3);
  const std::vector<Particle> nearest = particlesAround(upward(), particles, 2, 1);
  REQUIRE(nearest.size() == 2);
  CHECK(nearest[0].weight + nearest[1].weight == 4);
  const double expected = (std::log(2 * kInvPi) + 3 * std::log(2 * kInvPi * std::sqrt(0.5))) / 4;
  CHECK(*meanLogDensity(nearest, cosinePdf) == Approx(expected));
  CHECK_FALSE(meanLogDensity({}, cosinePdf));
}
