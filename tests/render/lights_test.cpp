// Light sources: sampling, densities and photons.

#include "materials/registry.h"
#include "materials/textures/bitmap.h"
#include "materials/textures/checkerboard.h"
#include "runtime/render/lights/delta_lights.h"
#include "runtime/render/training/particle_tracer.h"
#include "tests/support/chi2.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

// An environment with a small bright sun.
Image sunnySky() {
  Image image(32, 16);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x) image.at(x, y) = Rgb(0.2f + 0.02f * x, 0.3f, 0.1f * y);
  image.at(0, 3) = grey(500);  // on the seam
  return image;
}

Environment turnedSky() {
  const Eigen::Matrix3f rotation =
      (Eigen::AngleAxisf(0.7f, Vec3::UnitX()) * Eigen::AngleAxisf(2.1f, Vec3::UnitY())).toRotationMatrix();
  return {sunnySky(), rotation};
}

LightReceiver anySide(const Vec3& point) {
  return {point, Vec3::Zero()};
}

// The density of light sampling for a direction, found by tracing a ray.
float pdfByTracing(const RenderScene& scene, const Vec3& point, const Vec3& wi) {
  const auto hit = scene.tracer.trace({point, wi});
  const LightSelection selection = scene.lights.at(anySide(point));
  return hit ? selection.pdf(*hit) : selection.environmentPdf(wi);
}

struct LightCase {
  std::string name;
  Scene scene;
  Vec3 point;
};

// Scenes in which every light is visible from the point and occludes no other.
std::vector<LightCase> lightCases() {
  std::vector<LightCase> cases;
  const auto add = [&](const std::string& name, const Vec3& point) -> Scene& {
    return cases.emplace_back(LightCase{name, {}, point}).scene;
  };
  addEmitter(add("rectangle", {0, 0, 0}), rectangle({-1, 1, -2}, {2, 0, 0}, {0, 0, 3}), 1);
  addEmitter(add("sphere from outside", {0.5f, 0, 0}), Sphere{{2, 1, 1}, 0.9f}, 1);
  addEmitter(add("sphere from inside", {0.5f, 0.2f, 0}), Sphere{{0, 0, 0}, 1, true}, 1);
  addEmitter(add("disk", {0, 0, 0}), Disk{{0, 1, 1}, {1.5f, 0, 0}, {0, 0, 1.5f}}, 1);
  addEmitter(add("ellipse", {0, 0, 0}), Disk{{0, 1, 1}, {1.5f, 0, 0}, {0.6f, 0.1f, 0.8f}}, 1);
  addEmitter(add("cylinder from outside", {2, 0.5f, 0}), Cylinder{{0, 0, -1}, {0, 1, 0}, {-1, 0, 0}, {0, 0, 3}}, 1);
  addEmitter(add("cylinder from inside", {0.5f, 0.2f, 0}), Cylinder{{0, 0, -1}, {0, 1, 0}, {-1, 0, 0}, {0, 0, 3}, true},
             1);
  addEmitter(add("box from inside", {0.5f, 0.2f, 0}), box({-1, -1, -1}, {1, 2, 1}, true), 1);
  add("constant environment", {0, 0, 0}).environment = environment(Image(1, 1, grey(2)));
  add("environment", {0, 0, 0}).environment = turnedSky();
  Scene& several = add("several", {0, 0, 0});
  addEmitter(several, rectangle({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}), 1);
  addEmitter(several, Sphere{{3, 0, 0}, 0.5f}, 5);
  addEmitter(several, Disk{{0, 0, -3}, {1, 0, 0}, {0, 1, 0}}, 2);
  several.environment = turnedSky();
  return cases;
}

}  // namespace

TEST_CASE("render: the density of a light sample agrees with the density of its direction") {
  for (const LightCase& c : lightCases()) {
    CAPTURE(c.name);
    const RenderScene ready(c.scene);
    Rng rng(4);
    int differing = 0;
    for (int i = 0; i < 5000; ++i) {
      const double choice = rng.uniformDouble();
      const auto light = ready.lights.at(anySide(c.point)).sample(choice, rng.uniform2());
      if (!light || (!light->source && ready.tracer.occluded({c.point, light->wi}))) continue;
      const float pdf = pdfByTracing(ready, c.point, light->wi);
      differing += std::abs(pdf - light->pdf) > 5e-3f * light->pdf;
    }
    CHECK(differing <= 10);  // rays that miss an edge due to rounding
  }
}

TEST_CASE("render: light samples follow their density") {
  const std::vector<LightCase> cases = lightCases();
  for (const LightCase& c : cases) {
    const RenderScene ready(c.scene);
    Rng rng(11);
    const auto draw = [&]() -> std::optional<Vec3> {
      const double choice = rng.uniformDouble();
      const auto light = ready.lights.at(anySide(c.point)).sample(choice, rng.uniform2());
      if (!light || (!light->source && ready.tracer.occluded({c.point, light->wi}))) return std::nullopt;
      return light->wi;
    };
    const Chi2Result result = chi2Sphere(draw, [&](const Vec3& w) { return pdfByTracing(ready, c.point, w); });
    INFO(c.name << ": " << result.message);
    CHECK(result.passed(static_cast<int>(cases.size())));
  }
}

TEST_CASE("render: a wrong density of light sampling is detected") {
  const LightCase c = lightCases().back();
  const RenderScene ready(c.scene);
  Rng rng(11);
  const auto draw = [&]() -> std::optional<Vec3> {
    const double choice = rng.uniformDouble();
    const auto light = ready.lights.at(anySide(c.point)).sample(choice, rng.uniform2());
    return light ? std::optional(light->wi) : std::nullopt;
  };
  const auto wrong = [&](const Vec3& w) { return pdfByTracing(ready, c.point, w) * (1.0f + 0.3f * w.x()); };
  CHECK_FALSE(chi2Sphere(draw, wrong).passed());
}

TEST_CASE("render: every triangle of a light that is rarely chosen is reached") {
  constexpr int kLights = 1000, kSide = 70;
  Scene scene;
  for (int i = 0; i < kLights; ++i) addEmitter(scene, Sphere{{0.1f * static_cast<float>(i), 5, 0}, 0.01f}, 1e6f);
  TriangleMesh grid;  // of triangles of equal area
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const auto first = static_cast<std::uint32_t>(grid.positions.size());
      const Vec3 corner(static_cast<float>(x), 3, static_cast<float>(y));
      grid.positions.insert(grid.positions.end(),
                            {corner, corner + Vec3(1, 0, 0), corner + Vec3(1, 0, 1), corner + Vec3(0, 0, 1)});
      grid.triangles.push_back({first, first + 1, first + 2});
      grid.triangles.push_back({first, first + 2, first + 3});
    }
  addEmitter(scene, grid, 1e-3f);
  const RenderScene ready(scene);
  const auto triangleOf = [&](double choice) -> std::optional<std::size_t> {
    const auto light = ready.lights.at(anySide({0, 0, 0})).sample(choice, {0.5f, 0.25f});
    if (!light || light->source->position.y() != 3) return std::nullopt;
    const Vec3& p = light->source->position;
    const float x = std::floor(p.x()), y = std::floor(p.z());
    return 2 * static_cast<std::size_t>(y * kSide + x) + (p.z() - y > p.x() - x ? 1 : 0);
  };
  // The numbers that choose the mesh form one interval.
  double low = 1, high = 0;
  constexpr int kProbes = 1 << 17;
  for (int i = 0; i <= kProbes; ++i) {
    const double choice = std::min(static_cast<double>(i) / kProbes, 1 - 1e-9);
    if (!triangleOf(choice)) continue;
    low = std::min(low, choice - 1.0 / kProbes);
    high = std::max(high, choice + 1.0 / kProbes);
  }
  REQUIRE(low < high);
  std::vector<int> counts(2 * kSide * kSide);
  constexpr int kPerTriangle = 20;
  Rng rng(8);
  int drawn = 0;
  while (drawn < kPerTriangle * static_cast<int>(counts.size())) {
    const double choice = low + (std::min(high, 1.0) - low) * rng.uniformDouble();
    if (const auto triangle = triangleOf(choice)) {
      ++counts[*triangle];
      ++drawn;
    }
  }
  double chi2 = 0;
  for (const int count : counts) chi2 += std::pow(count - kPerTriangle, 2) / kPerTriangle;
  const auto freedom = static_cast<double>(counts.size() - 1);
  CHECK((chi2 - freedom) / std::sqrt(2 * freedom) < kMaxDeviation);
}

TEST_CASE("render: environment sampling is unbiased for the whole image and for blocks of it") {
  const EnvironmentLight light(turnedSky());
  Rng rng(6);
  Moments bySample, byBlock, uniform;
  const PixelBlock left{0, 0, 11, 16}, right{11, 0, 32, 16};
  const double leftFraction = light.blockWeight(left) / (light.blockWeight(left) + light.blockWeight(right));
  double worstSplit = 0;
  int differing = 0;
  for (int i = 0; i < 200000; ++i) {
    if (const auto s = light.sample(rng.uniform2())) bySample.add(luminance(s->radiance) / s->pdf);
    const bool first = rng.uniform() < leftFraction;
    if (const auto s = light.sample(first ? left : right, rng.uniform2())) {
      byBlock.add(luminance(s->radiance) / light.pdf(s->wi));
      differing += std::abs(light.pdf(first ? left : right, s->wi) - s->pdf) > 0.02f * s->pdf;
    }
    const Vec3 w = squareToSphere(rng.uniform2());
    uniform.add(luminance(light.radiance(w)) * 4 * kPi);
    const double split = leftFraction * light.pdf(left, w) + (1 - leftFraction) * light.pdf(right, w);
    worstSplit = std::max(worstSplit, std::abs(split / light.pdf(w) - 1));
  }
  CHECK(deviation(bySample, uniform) < kMaxDeviation);
  CHECK(deviation(byBlock, uniform) < kMaxDeviation);
  CHECK(worstSplit < 1e-4);
  CHECK(differing == 0);
  // With importance sampling, radiance over density hardly varies.
  CHECK(bySample.error() * std::sqrt(200000.0) < 0.1 * bySample.mean());
  CHECK(light.flux() == Approx(bySample.mean()).epsilon(0.03));
}

TEST_CASE("render: the environment image has the documented orientation") {
  Image image(8, 4, grey(0));
  image.at(2, 1) = grey(1);
  const EnvironmentLight light(environment(image));
  // The centre of that pixel by the convention in scene.h.
  const float u = 2.5f / 8, v = 1.5f / 4;
  const Vec3 w(std::sin(2 * kPi * u) * std::sin(kPi * v), std::cos(kPi * v),
               -std::cos(2 * kPi * u) * std::sin(kPi * v));
  CHECK(light.radiance(w).x() == Approx(1));
  CHECK(light.pixelOf(w) == Eigen::Vector2i(2, 1));
  CHECK(light.radiance(-w).x() == 0);
}

TEST_CASE("render: a direction that is not a number has no radiance and a pixel of the environment") {
  const EnvironmentLight light(turnedSky());
  const Vec3 none = Vec3::Constant(std::numeric_limits<float>::quiet_NaN());
  CHECK(light.radiance(none).isNaN().all());
  CHECK(light.pixelOf(none) == Eigen::Vector2i(0, 0));
}

TEST_CASE("render: invalid pixels of an environment are black") {
  Image image(2, 2, grey(1));
  image.at(0, 0) = Rgb(std::nanf(""), -1, kInfinity);
  const EnvironmentLight light(environment(image));
  CHECK(light.weight(0, 0) == 0);
  CHECK(light.radiance(Vec3::UnitY()).allFinite());
  Scene dark;
  dark.environment = environment(Image(4, 2));
  addShape(dark, Sphere{{0, 0, 0}, 1}, -1);
  const RenderScene ready(dark);
  CHECK(ready.lights.empty());
  CHECK_FALSE(ready.lights.at(anySide({2, 0, 0})).sample(0.5, {0.5f, 0.5f}));
  CHECK(ready.lights.at(anySide({2, 0, 0})).environmentPdf({0, 1, 0}) == 0);
}

TEST_CASE("render: the flux of delta lights agrees with closed forms at any scene size") {
  const auto power = [](const DeltaLight& light, float size) {
    Scene scene;
    addShape(scene, Sphere{{0, 0, 0}, size}, -1);
    scene.lights = {light};
    const RenderScene ready(scene);
    CHECK(ready.lights.environmentProbability() == 0);
    Rng rng(3);
    Moments photons;
    for (int i = 0; i < 20000; ++i) {
      const double choice = rng.uniformDouble();
      const Vec2 u1 = rng.uniform2();
      const auto photon = ready.lights.samplePhoton(choice, u1, rng.uniform2());
      photons.add(photon ? luminance(photon->power) : 0);
      if (photon) CHECK(photon->delta);
    }
    return photons;
  };
  CHECK(deviation(power(PointLight{{0, 0, 0}, grey(2)}, 1), 8 * kPi) < kMaxDeviation);
  const Vec3 axis = Vec3(1, 2, -2) / 3;
  const auto spot = [&](float cutoff, float beam) { return SpotLight{{0, 0, 0}, axis, grey(2), cutoff, beam}; };
  CHECK(deviation(power(spot(kPi, kPi), 1), 8 * kPi) < kMaxDeviation);
  CHECK(deviation(power(spot(kPi / 3, kPi / 3), 1), 2 * kPi) < kMaxDeviation);
  CHECK(deviation(power(spot(kPi / 2, 0), 1), 4 * kPi * (1 - 2 / kPi)) < kMaxDeviation);
  CHECK(deviation(power(spot(1e-3f, 1e-3f), 1), 2 * kPi * 1e-6) < kMaxDeviation);
  // A half-black texture over the square around the cone; for a projector the flux is π × image area × mean radiance.
  const TexturePtr board = makeCheckerboard(constantTexture(grey(1)), constantTexture(grey(0)));
  const ProjectedTexture projected{board, axis.unitOrthogonal() * 0.5f, axis.unitOrthogonal().cross(axis) * 0.25f};
  SpotLight textured = spot(kPi / 4, kPi / 4);
  textured.texture = {{board, axis.unitOrthogonal() * 0.5f, axis.unitOrthogonal().cross(axis) * 0.5f}};
  CHECK(deviation(power(textured, 1), 2 * kPi * (1 - std::sqrt(0.5))) < kMaxDeviation);
  CHECK(deviation(power(ProjectorLight{{0, 0, 0}, axis, 3, projected}, 1), kPi * 3 * 8 * 0.5) < kMaxDeviation);
  const double root3 = std::sqrt(3.0);  // the bounding box's corner
  for (const float size : {1e-9f, 1.0f, 1e15f})
    CHECK(deviation(power(DirectionalLight{axis, grey(2)}, size), 2 * kPi * std::pow(root3 * size, 2)) < kMaxDeviation);
}

TEST_CASE("render: light of a point light that passes a pane is not learnt") {
  // The floor is black, so that it sends no light back to the pane.
  Scene scene;
  addShape(scene, rectangle({-5, 0, -5}, {0, 0, 10}, {10, 0, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.0f)));
  Parameters glass;
  glass.set("int_ior", 1.5);
  glass.set("ext_ior", 1.0);
  addShape(scene, rectangle({-5, 0.5f, -5}, {0, 0, 10}, {10, 0, 0}), addMaterial(scene, makeBsdf("dielectric", glass)));
  const auto particles = [](const Scene& s) {
    const RenderScene ready(s);
    const Field nothing;
    const GuidedSampler sampler(s, nothing, nullptr);
    const RayCamera camera({}, {});
    return ParticleTracer(ready, camera, sampler, sampler, nullptr, 1).tracePhotons(0, 2000).radiance.particles();
  };
  Scene lamp = scene;
  scene.lights.push_back(PointLight{{0, 1, 0}, grey(1)});
  CHECK(particles(scene) == 0);
  addEmitter(lamp, Sphere{{0, 1, 0}, 0.1f}, 1);
  CHECK(particles(lamp) > 100);
}

TEST_CASE("render: light that only next-event estimation samples is not learnt") {
  Scene scene;
  addShape(scene, rectangle({-5, 0, -5}, {0, 0, 10}, {10, 0, 0}), addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  SECTION("point") {
    scene.lights.push_back(PointLight{{0, 1, 0}, grey(1)});
  }
  SECTION("directional") {
    scene.lights.push_back(DirectionalLight{{0, -1, 0}, grey(1)});
  }
  const RenderScene ready(scene);
  const Field nothing;
  const GuidedSampler sampler(scene, nothing, nullptr);
  const RayCamera camera({}, {});
  const auto particles = [&](const RenderScene& s) {
    return ParticleTracer(s, camera, sampler, sampler, nullptr, 1).tracePhotons(0, 2000).radiance.particles();
  };
  CHECK(particles(ready) == 0);
  addShape(scene, Sphere{{0, 5, 0}, 4}, 0);  // light reflected between floor and sphere is learnt
  CHECK(particles(RenderScene(scene)) > 10);
}

namespace {

// An image of four pixels, one of them black, projected along −y.
ProjectedTexture uneven(float perUnit) {
  auto image = std::make_shared<Image>(2, 2, grey(0));
  image->at(1, 0) = grey(1);
  image->at(0, 1) = grey(3);
  image->at(1, 1) = grey(0.5f);
  return {makeBitmap(image, {.nearest = true}), Vec3::UnitX() * perUnit, Vec3::UnitZ() * perUnit};
}

// Compares the flux of photons that reach a disk with its irradiance from light sampling, which needs cosine-weighted
// directions besides, as the density of the environment is zero in some directions.
void checkPhotons(const Scene& emitters) {
  Scene scene = emitters;
  const Disk receiver{{0, 0, 0}, {0, 0, 0.4f}, {0.4f, 0, 0}};
  addShape(scene, receiver, -1);
  const RenderScene ready(scene);
  const auto receiverShape = static_cast<int>(scene.shapes.size()) - 1;
  Rng rng(9);
  Moments photons, gathered;
  for (int i = 0; i < 400000; ++i) {
    const double choice = rng.uniformDouble();
    const Vec2 u1 = rng.uniform2();
    const auto photon = ready.lights.samplePhoton(choice, u1, rng.uniform2());
    const auto hit = photon ? ready.tracer.trace(photon->ray) : std::nullopt;
    const bool received = hit && hit->shape == receiverShape && hit->wo.z() > 0;
    photons.add(received ? luminance(photon->power) : 0);
    const Vec2 d = squareToDisk(rng.uniform2());
    const SurfacePoint point = pointOnDisk(receiver, d.x(), d.y());
    const double lightChoice = rng.uniformDouble();
    const LightSelection selection = ready.lights.at(LightReceiver{point.position, point.normal});
    const auto light = selection.sample(lightChoice, rng.uniform2());
    const bool lit = light && light->wi.y() > 0 && ready.visible(point, *light);
    double irradiance = 0;
    if (lit) {
      const float weight = light->delta ? 1.0f : misWeight(light->pdf, light->wi.y() * kInvPi);
      irradiance += weight * luminance(light->radiance) * light->wi.y() / light->pdf;
    }
    const Vec3 local = squareToCosineHemisphere(rng.uniform2()), wi(local.x(), local.z(), local.y());
    const float cosinePdf = std::max(wi.y() * kInvPi, 1e-9f);
    const std::optional<SurfaceHit> seen = ready.tracer.trace(spawnRay(point, wi));
    if (!seen)
      irradiance +=
          kPi * luminance(ready.lights.environmentRadiance(wi)) * misWeight(cosinePdf, selection.environmentPdf(wi));
    else if (seen->emitter)
      irradiance += kPi * luminance(emittedRadiance(*seen)) * misWeight(cosinePdf, selection.pdf(*seen));
    gathered.add(irradiance * kPi * 0.16);
  }
  CHECK(photons.mean() > 0);
  CHECK(deviation(photons, gathered) < kMaxDeviation);
}

}  // namespace

TEST_CASE("render: photons carry the same flux as light sampling") {
  Scene scene;
  SECTION("rectangle") {
    addEmitter(scene, rectangle({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}), 2);
  }
  SECTION("sphere") {
    addEmitter(scene, Sphere{{0.5f, 1.5f, 0}, 0.5f}, 2);
  }
  SECTION("disk") {
    addEmitter(scene, Disk{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}, 2);
  }
  SECTION("ellipse") {
    addEmitter(scene, Disk{{0, 1, 0}, {1, 0, 0}, {0.4f, 0.1f, 0.5f}}, 2);
  }
  SECTION("inside a sphere") {
    addEmitter(scene, Sphere{{0, 0, 0}, 1.5f, true}, 2);
  }
  SECTION("environment") {
    scene.environment = turnedSky();
  }
  SECTION("environment of which next-event estimation samples a half") {
    Image image(64, 32, grey(0.3f));
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x) image.at(x, y) = grey(1);
    scene.environment = environment(image);
  }
  SECTION("point") {
    scene.lights.push_back(PointLight{{0.5f, 1, 0.2f}, grey(2)});
  }
  SECTION("spot") {
    const Vec3 axis = Vec3(-0.4f, -1, 0).normalized();
    scene.lights.push_back(SpotLight{{0.5f, 1, 0.2f}, axis, grey(2), 0.6f, 0.2f});
  }
  SECTION("spot with a texture") {
    scene.lights.push_back(SpotLight{{0, 1, 0}, -Vec3::UnitY(), grey(2), 0.6f, 0.2f, uneven(0.5f / std::tan(0.6f))});
  }
  SECTION("projector") {
    scene.lights.push_back(ProjectorLight{{0, 1, 0}, -Vec3::UnitY(), 2, uneven(0.7f)});
  }
  SECTION("directional") {
    scene.lights.push_back(DirectionalLight{Vec3(1, -2, 0).normalized(), grey(2)});
  }
  SECTION("mixed") {
    scene.lights.push_back(PointLight{{0.5f, 1, 0.2f}, grey(2)});
    scene.lights.push_back(DirectionalLight{Vec3(1, -2, 0).normalized(), grey(3)});
    scene.environment = environment(Image(1, 1, grey(1)));
    addEmitter(scene, Sphere{{0.5f, 1.5f, 0}, 0.5f}, 20);
  }
  checkPhotons(scene);
}

namespace {

// The mean of 1/density over photons: the measure of the points and directions from which the only light of the scene
// emits.
Moments measureOfPhotons(const Scene& scene) {
  const RenderScene ready(scene);
  Moments measure;
  Rng rng(3);
  for (int i = 0; i < 100000; ++i) {
    const double choice = rng.uniformDouble();
    const Vec2 u1 = rng.uniform2();
    const auto photon = ready.lights.samplePhoton(choice, u1, rng.uniform2());
    measure.add(photon ? 1 / photon->density : 0);
  }
  return measure;
}

}  // namespace

TEST_CASE("render: the density of photons integrates to one over all points and directions") {
  Scene scene;
  double expected = 0;
  // The radius of the sphere around the scene is 1, and its disc has the area π.
  addShape(scene, Sphere{{0, 0, 0}, 1 / std::sqrt(3.0f)}, addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  SECTION("sphere") {
    scene.shapes[0].emitter = AreaEmitter{constantTexture(grey(1))};
    expected = 4 * M_PI / 3 * 2 * M_PI;
  }
  SECTION("constant environment") {
    scene.environment = environment(Image(1, 1, grey(1)));
    expected = 4 * M_PI * M_PI;
  }
  SECTION("environment") {
    scene.environment = environment(sunnySky());
    expected = 4 * M_PI * M_PI;
  }
  SECTION("point") {
    scene.lights.push_back(PointLight{{0.5f, 1, 0.2f}, grey(2)});
    expected = 4 * M_PI;
  }
  SECTION("spot") {
    scene.lights.push_back(SpotLight{{0.5f, 1, 0.2f}, -Vec3::UnitY(), grey(2), 0.6f, 0.2f});
    expected = 2 * M_PI * (1 - std::cos(0.6));
  }
  SECTION("projector") {
    // A square pyramid with the height 1 over a base of 1 by 1.
    const auto image = constantTexture(grey(1));
    scene.lights.push_back(ProjectorLight{{0, 2, 0}, -Vec3::UnitY(), 1, {image, Vec3::UnitX(), Vec3::UnitZ()}});
    expected = 4 * std::asin(0.25 / 1.25);
  }
  SECTION("directional") {
    scene.lights.push_back(DirectionalLight{-Vec3::UnitY(), grey(2)});
    expected = M_PI;
  }
  CHECK(deviation(measureOfPhotons(scene), expected) < kMaxDeviation);
}

TEST_CASE("render: light samples and hits on lights have the densities of photons") {
  std::vector<LightCase> cases = lightCases();
  Scene& delta = cases.emplace_back(LightCase{"delta lights", {}, {0, 0, 0}}).scene;
  addShape(delta, Disk{{0, -1, 0}, {0, 0, 2}, {2, 0, 0}}, addMaterial(delta, std::make_shared<Diffuse>(0.5f)));
  delta.lights = {
      PointLight{{0.5f, 1, 0.2f}, grey(2)}, DirectionalLight{-Vec3::UnitY(), grey(2)},
      SpotLight{{0.5f, 1, 0.2f}, -Vec3::UnitY(), grey(2), 1.2f, 0.2f},
      ProjectorLight{{0, 2, 0}, -Vec3::UnitY(), 1, {constantTexture(grey(1)), Vec3::UnitX(), Vec3::UnitZ()}}};
  for (const LightCase& c : cases) {
    CAPTURE(c.name);
    const RenderScene ready(c.scene);
    Rng rng(4);
    int differing = 0, compared = 0;
    const auto compare = [&](float a, float b) { ++compared, differing += !(std::abs(a - b) <= 1e-2f * b); };
    for (int i = 0; i < 3000; ++i) {
      // The point that next-event estimation finds, as the origin of a photon.
      const double choice = rng.uniformDouble();
      const LightSelection nextEvent = ready.lights.at(anySide(c.point));
      const auto light = nextEvent.sample(choice, rng.uniform2());
      if (!light) continue;
      EmittedPhoton photon;
      photon.far = !light->source;
      photon.delta = light->delta;
      photon.light = light->light;
      photon.normal = light->source ? light->source->normal : Vec3(Vec3::Zero());
      photon.ray = {light->source ? light->source->position : Vec3(Vec3::Zero()), -light->wi};
      const bool point = light->delta && light->source;
      compare(nextEvent.pdf(photon, light->distance), light->pdf * (point ? light->distance * light->distance : 1));
      if (light->delta) continue;
      const auto hit = ready.tracer.trace({c.point, light->wi});
      if (hit.has_value() == light->source.has_value())
        compare(hit ? ready.lights.photonDensity(*hit) : ready.lights.environmentPhotonDensity(light->wi),
                ready.lights.photonDensity(*light));
    }
    for (int i = 0; i < 3000; ++i) {
      // A photon, as a sample of next-event estimation.
      const double choice = rng.uniformDouble();
      const Vec2 u1 = rng.uniform2();
      const auto photon = ready.lights.samplePhoton(choice, u1, rng.uniform2());
      if (!photon) continue;
      LightSample light{-photon->ray.direction, 1, photon->power, 1, std::nullopt, photon->delta, photon->light};
      if (!photon->far) light.source = SurfacePoint{photon->ray.origin, photon->normal, {0, 0}, 0};
      compare(ready.lights.photonDensity(light), photon->density);
    }
    CHECK(compared > 3000);
    CHECK(differing <= 10);  // grazing rays
  }
}

TEST_CASE("render: projectors and textured spot lights project their images") {
  // The irradiance of a floor at distance 2 below the light.
  const auto irradiance = [](const DeltaLight& light, const Vec3& at) {
    const auto sample = illuminate(light, at);
    return sample ? sample->radiance.x() * sample->wi.y() : 0.0f;
  };
  // At distance 1 the projected image extends from −1 to 1 in x and z.
  const ProjectorLight projector{{0, 2, 0}, -Vec3::UnitY(), 2, uneven(0.5f)};
  const auto shown = [&](float x, float z) { return irradiance(projector, {x, 0, z}) / kPi; };
  CHECK(shown(-1.9f, -0.1f) == 0);
  CHECK(shown(0.1f, -1.9f) == Approx(2 * 1 / 4.0));
  CHECK(shown(1.9f, -0.1f) == Approx(2 * 1 / 4.0));
  CHECK(shown(-0.1f, 0.1f) == Approx(2 * 3 / 4.0));
  CHECK(shown(1.9f, 1.9f) == Approx(2 * 0.5 / 4.0));
  CHECK(shown(2.1f, 1) == 0);
  CHECK(irradiance(projector, {0.1f, 4, -0.1f}) == 0);  // behind it

  SpotLight spot{{0, 2, 0}, -Vec3::UnitY(), grey(2), kPi / 4, kPi / 4};
  const float plain = irradiance(spot, {0.4f, 0, -0.3f});
  spot.texture = uneven(0.5f);
  CHECK(irradiance(spot, {0.4f, 0, -0.3f}) == Approx(plain));
  CHECK(irradiance(spot, {-0.4f, 0, 0.3f}) == Approx(3 * plain));
  CHECK(irradiance(spot, {0.4f, 0, 0.3f}) == Approx(0.5 * plain));
  CHECK(irradiance(spot, {-0.4f, 0, -0.3f}) == 0);
}
