// How good guiding is in pictures: the variance of path tracing, guiding by illumination and the product on a small
// glossy scene, and where photons of the environment start.

#include <catch2/catch.hpp>

#include "runtime/render/lights/environment_guide.h"
#include "tests/support/render_test_tools.h"
#include "tests/support/studio.h"

using namespace lobe;
using namespace lobe::test;

namespace {

/// A closed room with glossy floor and walls, whose lamp shines at the ceiling only, so that next-event estimation
/// finds no light at most points.
constexpr const char* kGlossyRoom = R"(<scene version="2.1.0">
  <sensor type="perspective">
    <float name="fov" value="60"/>
    <transform name="to_world"><lookat origin="0, 1.4, 1.9" target="0, 0.6, -1" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/></film>
  </sensor>
  <bsdf type="twosided" id="walls"><bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></bsdf>
  <bsdf type="twosided" id="brushed"><bsdf type="roughconductor">
    <string name="distribution" value="ggx"/>
    <float name="alpha_u" value="0.06"/><float name="alpha_v" value="0.25"/>
  </bsdf></bsdf>
  <shape type="cube">
    <transform name="to_world"><scale x="2" y="1.5" z="2"/><translate y="1.5"/></transform>
    <ref id="walls"/>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale x="1.9" y="1" z="1.9"/><translate y="0.01"/></transform>
    <ref id="brushed"/>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><scale x="1.9" y="1.4" z="1"/><translate y="1.5" z="-1.98"/></transform>
    <ref id="brushed"/>
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale x="0.3" y="1" z="0.3"/><translate x="1.4" y="2.4" z="-1.2"/></transform>
    <emitter type="area"><rgb name="radiance" value="40"/></emitter>
  </shape>
</scene>)";

/// The mean relative variance of a sample over the pixels, green channel.
double relativeVariance(const Studio& studio, const Integrator& integrator) {
  constexpr int kSamples = 128;
  const Film film = studio.render(integrator, kSamples, 3);
  const Image mean = film.mean(), variance = film.varianceOfMean();
  double sum = 0;
  for (std::size_t p = 0; p < mean.pixels.size(); ++p) {
    const float m = mean.pixels[p].y();
    sum += kSamples * variance.pixels[p].y() / (m * m + 1e-6f);
  }
  return sum / static_cast<double>(mean.pixels.size());
}

}  // namespace

TEST_CASE("quality: the product has less variance than guiding by illumination and that less than path tracing") {
  const Folder folder;
  std::ofstream(folder / "room.xml") << kGlossyRoom;
  const Studio studio(readScene((folder / "room.xml").string()), 24, 16);
  const double path = relativeVariance(studio, studio.path()), guided = relativeVariance(studio, studio.guided()),
               product = relativeVariance(studio, studio.product());
  INFO("relative variance of a sample: path " << path << ", guided " << guided << ", product " << product);
  CHECK(guided < 0.7 * path);
  CHECK(product < 0.6 * guided);
}

TEST_CASE("quality: photons of the environment start where importons have carried the most") {
  Scene scene;
  addShape(scene, rectangle({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  Image sky;
  sky.width = 64;
  sky.height = 32;
  sky.pixels.assign(64 * 32, grey(1));
  scene.environment = environment(sky);
  const RenderScene ready(scene);
  EnvironmentGuide guide(ready.lights);
  // As many importons leave in one direction as in the other, but those of the first carry 50 times as much.
  const Vec3 heavy = Vec3(0.8f, 0.6f, 0).normalized(), light = Vec3(-0.8f, 0.6f, 0).normalized();
  for (int i = 0; i < 200; ++i) {
    guide.learn(Vec3::Zero(), heavy, 50);
    guide.learn(Vec3::Zero(), light, 1);
  }
  guide.update();
  Rng rng(1);
  int photons = 0, fromHeavy = 0;
  for (int i = 0; i < 4000; ++i) {
    const float choice = rng.uniform();
    const Vec2 u = rng.uniform2();
    const std::optional<EmittedPhoton> photon = guide.sample(choice, u, rng.uniform2());
    if (!photon) continue;
    ++photons;
    if (photon->ray.direction.dot(-heavy) > 0.9f) ++fromHeavy;
  }
  REQUIRE(photons > 2000);
  CHECK(fromHeavy == Approx(photons * 50.0 / 51).epsilon(0.02));
}

TEST_CASE("quality: the irradiance of records is that of the surface, for any number of photons") {
  // Uniform light of radiance 1 from everywhere: E = π.
  Scene scene;
  addShape(scene, rectangle({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  scene.environment = environment(Image(8, 4, grey(1)));
  scene.camera.width = scene.camera.height = 16;
  scene.camera.toWorld.col(1) << 0, 0, 1, 0;  // looks down from above
  scene.camera.toWorld.col(2) << 0, -1, 0, 0;
  scene.camera.toWorld.col(3) << 0, 2, 0, 1;
  const RenderScene ready(scene);
  const RayCamera camera(scene.camera, {});
  for (const int photons : {20000, 80000}) {
    CAPTURE(photons);
    TrainingPlan plan;
    plan.passes = 3;
    plan.photons = photons;
    plan.importons = 4000;
    const Field field = trainIllumination(ready, camera, nullptr, plan).field;
    // Away from the edge, where records look beyond the surface.
    Moments irradiance;
    for (const IlluminationRecord& r : cacheOf(field).records())
      if (r.position.cwiseAbs().maxCoeff() < 0.8f) irradiance.add(r.irradiance);
    CHECK(irradiance.mean() == Approx(kPi).epsilon(0.1));
  }
}
