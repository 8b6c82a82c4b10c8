// Bidirectional path tracing: it estimates the same image as path tracing for every kind of light, material and camera;
// white furnaces and closed forms; independence of threads; and wrong densities are detected.

#include <atomic>
#include <cstring>

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <catch2/catch.hpp>

#include "runtime/render/integrators/bidirectional_paths.h"
#include "tests/support/batches.h"
#include "tests/support/render_test_tools.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

// Filters and cameras are tested apart from lights and materials.
constexpr const char* kCamera = R"(<sensor type="perspective"><float name="fov" value="50"/>
  <transform name="to_world"><lookat origin="0, -6, 2.5" target="0, 0, 0.9" up="0, 0, 1"/></transform>
  <film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="15"/>
  <rfilter type="box"/></film></sensor>)";

// A floor and a back wall, on which light paths end, with a small box.
constexpr const char* kFloor = R"(
  <bsdf type="diffuse" id="grey"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
  <bsdf type="twosided" id="glossy"><bsdf type="roughconductor"><string name="distribution" value="ggx"/>
    <float name="alpha" value="0.25"/></bsdf></bsdf>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/></transform><ref id="grey"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="90"/>
    <translate y="2.5"/></transform><ref id="glossy"/></shape>
  <shape type="cube"><transform name="to_world"><scale value="0.5"/><rotate z="1" angle="30"/>
    <translate x="-1.3" z="0.5"/></transform><ref id="glossy"/></shape>)";

constexpr const char* kLamp = R"(<shape type="rectangle">
  <transform name="to_world"><scale value="0.7"/><rotate x="1" angle="160"/><translate x="1" z="3"/></transform>
  <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>)";

Scene sceneWith(const std::string& body, const std::string& camera = kCamera) {
  return readText("<scene version=\"3.0.0\">" + body + camera + "</scene>");
}

/// Whether bidirectional path tracing, and path tracing with light paths, agree with path tracing on the scene.
bool agreesWithPath(const Stage& stage, int batches = 48, int samples = 12) {
  const auto path = renderBlocks(stage, stage.path(), {batches, 2 * samples, 1});
  double light = 0;
  for (const Block& block : path) light += block.mean;
  REQUIRE(light > 0);
  return agree(path, renderBlocks(stage, stage.bdpt(), {batches, samples, 1000})) &&
         agree(path, renderBlocks(stage, stage.pathWithLight(), {batches, samples, 2000}));
}

}  // namespace

TEST_CASE("bidirectional: every kind of light gives the image of path tracing", "[slow]") {
  const auto [name, light] = GENERATE(table<std::string, std::string>(
      {{"rectangle", kLamp},
       {"sphere", R"(<shape type="sphere"><point name="center" x="1" y="0" z="1.5"/><float name="radius" value="0.4"/>
          <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>)"},
       {"textured", R"(<shape type="rectangle"><transform name="to_world"><scale value="1.5"/>
          <rotate x="1" angle="170"/><translate z="3"/></transform><emitter type="area"><texture name="radiance"
          type="checkerboard"><rgb name="color0" value="0, 0, 0"/><rgb name="color1" value="5, 1, 3"/>
          <float name="uscale" value="3"/></texture></emitter></shape>)"},
       {"point", R"(<emitter type="point"><point name="position" x="1" y="-1" z="2.5"/>
          <rgb name="intensity" value="9, 8, 7"/></emitter>)"},
       {"spot", R"(<emitter type="spot"><transform name="to_world"><lookat origin="2, -2, 3" target="0, 0, 0"
          up="0, 0, 1"/></transform><float name="cutoff_angle" value="35"/><float name="beam_width" value="15"/>
          <rgb name="intensity" value="30, 20, 25"/></emitter>)"},
       {"textured spot", R"(<emitter type="spot"><transform name="to_world"><lookat origin="2, -2, 3" target="0, 0, 0"
          up="0, 0, 1"/></transform><float name="cutoff_angle" value="35"/><rgb name="intensity" value="30, 20, 25"/>
          <texture name="texture" type="checkerboard"/></emitter>)"},
       {"projector", R"(<emitter type="projector"><transform name="to_world"><lookat origin="2, -2, 3" target="0, 0, 0"
          up="0, 0, 1"/></transform><float name="fov" value="50"/><texture name="irradiance" type="checkerboard"/>
          <float name="scale" value="9"/></emitter>)"},
       {"directional", R"(<emitter type="directional"><vector name="direction" x="-1" y="2" z="-2"/>
          <rgb name="irradiance" value="3, 2, 2.5"/></emitter>)"},
       {"constant environment", R"(<emitter type="constant"><rgb name="radiance" value="0.5, 0.6, 0.7"/></emitter>)"},
       {"many", std::string(kLamp) + R"(<emitter type="constant"><rgb name="radiance" value="0.1, 0.1, 0.1"/></emitter>
          <emitter type="directional"><vector name="direction" x="-1" y="2" z="-2"/>
          <rgb name="irradiance" value="0.3, 0.2, 0.2"/></emitter>
          <emitter type="point"><point name="position" x="1" y="-1" z="2.5"/><rgb name="intensity" value="3, 2, 1"/>
          </emitter>)"}}));
  CAPTURE(name);
  CHECK(agreesWithPath(Stage(sceneWith(kFloor + light))));
}

namespace {

/// An environment with a broad bright spot above the back wall, in a scene in which +z is up.
Environment brightSpot() {
  Image image(32, 16);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x) {
      const float dx = static_cast<float>(x - 20) / 3, dy = static_cast<float>(y - 4) / 2;
      image.at(x, y) = grey(0.1f + 6 * std::exp(-dx * dx - dy * dy));
    }
  Eigen::Matrix3f toWorld;
  toWorld << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return {std::move(image), toWorld};
}

}  // namespace

TEST_CASE("bidirectional: an environment with a bright spot gives the image of path tracing") {
  Scene scene = sceneWith(kFloor);
  scene.environment = brightSpot();
  CHECK(agreesWithPath(Stage(std::move(scene))));
}

TEST_CASE("bidirectional: every kind of surface gives the image of path tracing", "[slow]") {
  const auto [name, surface] = GENERATE(table<std::string, std::string>(
      {{"mirror", R"(<bsdf type="conductor"/>)"},
       {"glass", R"(<bsdf type="dielectric"/>)"},
       {"frosted glass", R"(<bsdf type="roughdielectric"><string name="distribution" value="ggx"/>
          <float name="alpha" value="0.3"/></bsdf>)"},
       {"plastic", R"(<bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.5, 0.3, 0.2"/></bsdf>)"},
       {"rough plastic", R"(<bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf>)"},
       {"coating", R"(<bsdf type="coating"><rgb name="sigma_a" value="0.1, 0.3, 0.6"/>
          <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></bsdf>)"},
       {"pane", R"(<bsdf type="thindielectric"/>)"},
       {"mask", R"(<bsdf type="mask"><float name="opacity" value="0.6"/><bsdf type="twosided"><bsdf type="diffuse"/>
          </bsdf></bsdf>)"},
       {"principled", R"(<bsdf type="principled"><float name="roughness" value="0.4"/>
          <float name="spec_trans" value="0.6"/><float name="metallic" value="0.2"/></bsdf>)"},
       {"thin principled", R"(<bsdf type="principledthin"><float name="roughness" value="0.5"/>
          <float name="spec_trans" value="0.5"/><float name="diff_trans" value="0.8"/></bsdf>)"},
       {"normal map", R"(<bsdf type="twosided"><bsdf type="normalmap"><texture type="checkerboard">
          <float name="uscale" value="8"/><float name="vscale" value="6"/>
          <rgb name="color0" value="0.8, 0.5, 0.9"/><rgb name="color1" value="0.3, 0.9, 0.8"/></texture>
          <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></bsdf></bsdf>)"},
       {"normal map, corrected", R"(<bsdf type="normalmap"><texture type="checkerboard">
          <float name="uscale" value="8"/><float name="vscale" value="6"/>
          <rgb name="color0" value="0.95, 0.5, 0.7"/><rgb name="color1" value="0.2, 0.9, 0.7"/></texture>
          <boolean name="flip_invalid_normals" value="true"/><boolean name="use_shadowing_function" value="true"/>
          <bsdf type="plastic"/></bsdf>)"}}));
  CAPTURE(name);
  const std::string ball =
      "<shape type=\"sphere\"><point name=\"center\" x=\"0.8\" y=\"-0.3\" z=\"1\"/>"
      "<float name=\"radius\" value=\"0.9\"/>" +
      surface + "</shape>";
  // The caustic of the mirror has heavy tails, so that the mean of few batches is not normally distributed.
  CHECK(agreesWithPath(Stage(sceneWith(kFloor + ball + kLamp)), name == "mirror" ? 192 : 48));
}

TEST_CASE("bidirectional: interpolated normals give the image of path tracing") {
  Scene scene = sceneWith(std::string(kFloor) + kLamp);
  addShape(scene, sphereMesh({0.8f, -0.3f, 1}, 0.9f, 4),
           addMaterial(scene, std::make_shared<HalfMirror>(0.5f, 0.3f, 0.4f)));
  addShape(scene, sphereMesh({-1.3f, 0.3f, 1.6f}, 0.6f, 3), addMaterial(scene, std::make_shared<Diffuse>(0.7f)));
  CHECK(agreesWithPath(Stage(std::move(scene))));
}

TEST_CASE("bidirectional: shading normals inside glass give the image of path tracing", "[slow]") {
  // Camera and floor are inside a block of glass, under a lamp outside, which only light paths and chance find: the
  // adjoint corrections for normals and refraction do not cancel.
  const std::string block = R"(
    <shape type="cube"><transform name="to_world"><scale x="8" y="8" z="2"/><translate z="1"/></transform>
      <bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="0.5" y="0.5" z="4"/><float name="radius" value="0.6"/>
      <emitter type="area"><rgb name="radiance" value="40, 40, 40"/></emitter></shape>)";
  Scene scene;
  SECTION("interpolated") {
    scene = sceneWith(block);
    TriangleMesh floor = rectangle({-3, -3, 0}, {6, 0, 0}, {0, 6, 0});
    floor.normals.assign(4, Vec3(0.6f, 0, 0.8f));
    // Reflects the light onto a wall on the right.
    addShape(scene, floor, addMaterial(scene, std::make_shared<HalfMirror>(0.3f, 0.6f, 0.6f)));
    addShape(scene, rectangle({2.5f, -3, 0}, {0, 0, 2.5f}, {0, 6, 0}),
             addMaterial(scene, std::make_shared<Diffuse>(0.5f)));
  }
  SECTION("mapped, turned towards the viewer") {
    scene = sceneWith(block + R"(<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform>
      <bsdf type="normalmap"><texture type="checkerboard"><rgb name="color0" value="0.5, 0.95, 0.65"/>
        <rgb name="color1" value="0.5, 0.95, 0.65"/></texture><boolean name="flip_invalid_normals" value="true"/>
        <boolean name="use_shadowing_function" value="true"/><bsdf type="plastic"/></bsdf></shape>)");
  }
  const Stage stage(std::move(scene));
  const auto path = renderBlocks(stage, stage.path(), {48, 200, 1});
  CHECK(agree(path, renderBlocks(stage, stage.bdpt(), {48, 24, 1000})));
  CHECK(agree(path, renderBlocks(stage, stage.pathWithLight(), {48, 24, 2000})));
}

TEST_CASE("bidirectional: the caustic of a glass ball under a small lamp is that of path tracing") {
  const Stage stage(sceneWith(std::string(kFloor) + R"(
    <shape type="sphere"><point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.6"/>
      <bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="1" y="-0.5" z="3.2"/><float name="radius" value="0.2"/>
      <emitter type="area"><rgb name="radiance" value="40, 40, 40"/></emitter></shape>)"));
  const int samples = 12, samplesOfPath = 160;
  const auto path = renderBlocks(stage, stage.path(), {48, samplesOfPath, 1});
  const auto bdpt = renderBlocks(stage, stage.bdpt(), {48, samples, 1000});
  const auto light = renderBlocks(stage, stage.pathWithLight(), {48, samples, 2000});
  const auto fewer = renderBlocks(stage, stage.pathWithLight(0.25), {48, samples, 3000});
  CHECK(agree(path, bdpt));
  CHECK(agree(path, light));
  CHECK(agree(path, fewer));
  const auto variance = [](const std::vector<Block>& all) {
    double sum = 0;
    for (const Block& block : all) sum += block.variance;
    return sum;
  };
  CHECK(samples * variance(bdpt) < 0.5 * samplesOfPath * variance(path));
  CHECK(samples * variance(light) < 0.5 * samplesOfPath * variance(path));
  CHECK(samples * variance(fewer) < 0.5 * samplesOfPath * variance(path));
}

TEST_CASE("bidirectional: every kind of camera gives the image of path tracing", "[slow]") {
  const std::string place = R"(<transform name="to_world"><lookat origin="0, -6, 2.5" target="0, 0, 0.9"
    up="0, 0, 1"/></transform>)";
  const std::string film = R"(<film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="15"/>
    <rfilter type="box"/></film></sensor>)";
  const std::string perspective = "<sensor type=\"perspective\"><float name=\"fov\" value=\"50\"/>";
  const auto filtered = [&](const std::string& filter) {
    return perspective + place +
           "<film type=\"hdrfilm\"><integer name=\"width\" value=\"20\"/>"
           "<integer name=\"height\" value=\"15\"/><rfilter type=\"" +
           filter + "\"/></film></sensor>";
  };
  const auto [name, camera] = GENERATE_COPY(table<std::string, std::string>(
      {{"thin lens",
        "<sensor type=\"thinlens\"><float name=\"fov\" value=\"50\"/><float name=\"aperture_radius\" "
        "value=\"0.4\"/><float name=\"focus_distance\" value=\"4\"/>" +
            place + film},
       {"orthographic", R"(<sensor type="orthographic"><transform name="to_world"><scale x="3" y="3"/>
          <lookat origin="0, -6, 2.5" target="0, 0, 0.9" up="0, 0, 1"/></transform>)" +
                            film},
       {"clip planes",
        perspective + "<float name=\"near_clip\" value=\"5\"/><float name=\"far_clip\" value=\"8\"/>" + place + film},
       {"shifted", perspective + "<float name=\"principal_point_offset_x\" value=\"0.2\"/>" + place + film},
       {"scaled", perspective + R"(<transform name="to_world"><scale x="2" y="1" z="1"/>
          <lookat origin="0, -6, 2.5" target="0, 0, 0.9" up="0, 0, 1"/></transform>)" +
                      film},
       {"crop", perspective + place + R"(<film type="hdrfilm"><integer name="width" value="40"/>
          <integer name="height" value="40"/><integer name="crop_offset_x" value="12"/>
          <integer name="crop_offset_y" value="9"/><integer name="crop_width" value="20"/>
          <integer name="crop_height" value="15"/><rfilter type="box"/></film></sensor>)"},
       {"tent", filtered("tent")},
       {"gaussian", filtered("gaussian")},
       {"mitchell", filtered("mitchell")}}));
  CAPTURE(name);
  CHECK(agreesWithPath(Stage(sceneWith(std::string(kFloor) + kLamp, camera))));
}

TEST_CASE("bidirectional: dark and hidden emitters and the maximum depth give the image of path tracing") {
  const std::string lamp = R"(<shape type="sphere"><point name="center" x="0.3" y="-0.5" z="1.5"/><ref id="grey"/>
    <float name="radius" value="0.5"/><emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>)";
  Stage stage(sceneWith(kFloor + lamp));
  SECTION("dark") {
    stage.options.emitterVisibility = EmitterVisibility::dark;
  }
  SECTION("hidden") {
    stage.options.emitterVisibility = EmitterVisibility::hidden;
  }
  SECTION("depth") {
    stage.options.maxDepth = GENERATE(1, 2, 3, 5);
  }
  CHECK(agreesWithPath(stage));
}

TEST_CASE("bidirectional: the radiance in a furnace is emission over one minus albedo") {
  const float emission = 0.5f, albedo = 0.6f;
  Scene scene = sceneWith("");
  scene.camera.toWorld.setIdentity();
  SECTION("diffuse") {
    addEmitter(scene, box({-1, -2, -3}, {3, 2, 1}, true), emission,
               addMaterial(scene, std::make_shared<Diffuse>(albedo)));
  }
  SECTION("half mirror") {
    addEmitter(scene, box({-1, -2, -3}, {3, 2, 1}, true), emission,
               addMaterial(scene, std::make_shared<HalfMirror>(0.4f, 0.2f, 0.3f)));
  }
  SECTION("sphere") {
    addEmitter(scene, Sphere{{0, 0, 1}, 2.0f, true}, emission, addMaterial(scene, std::make_shared<Diffuse>(albedo)));
  }
  const Stage stage(std::move(scene));
  const auto found = renderBlocks(stage, stage.bdpt(), {48, 16, 1});
  CHECK(agree(found, std::vector<Block>(found.size(), Block{emission / (1 - albedo), 0})));
  const auto withLight = renderBlocks(stage, stage.pathWithLight(2.5), {48, 16, 1});
  CHECK(agree(withLight, std::vector<Block>(found.size(), Block{emission / (1 - albedo), 0})));
}

TEST_CASE("vcm: the radiance in a furnace is emission over one minus albedo", "[slow]") {
  // On a large sphere merging has no noticeable bias.
  const float emission = 0.5f, albedo = 0.6f;
  Scene scene = sceneWith("");
  scene.camera.toWorld.setIdentity();
  scene.camera.width = 60, scene.camera.height = 45;  // enough light paths for merging to have most of the weight
  const bool mirror = GENERATE(false, true);
  const BsdfPtr wall =
      mirror ? BsdfPtr(std::make_shared<HalfMirror>(0.4f, 0.2f, 0.3f)) : std::make_shared<Diffuse>(albedo);
  addEmitter(scene, Sphere{{0, 0, 1}, 2.0f, true}, emission, addMaterial(scene, wall));
  const Stage stage(std::move(scene));
  const float radius = GENERATE(0.02f, 0.1f);
  const auto found = renderBlocks(stage, stage.vcm(radius), {48, 3, 1});
  CHECK(agree(found, std::vector<Block>(found.size(), Block{emission / (1 - albedo), 0})));
}

TEST_CASE("vcm: a small radius gives the image of path tracing, nearly") {
  // Lights whose light paths matter, and a mirror in which merging finds a caustic.
  const Stage stage(sceneWith(std::string(kFloor) + kLamp + R"(<shape type="sphere">
    <point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.9"/><bsdf type="dielectric"/></shape>)"));
  const auto path = renderBlocks(stage, stage.path(), {48, 48, 1});
  const auto vcm = renderBlocks(stage, stage.vcm(0.02f), {48, 12, 1000});
  double sumOfPath = 0, sum = 0;
  for (std::size_t i = 0; i < path.size(); ++i) sumOfPath += path[i].mean, sum += vcm[i].mean;
  CHECK(sum == Approx(sumOfPath).epsilon(0.02));
}

TEST_CASE("vcm: the image does not depend on threads, and the radius shrinks") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto image = [&](int threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    Film film(stage.camera.width(), stage.camera.height());
    RenderOptions options;
    options.samples = 4;
    VcmIntegrator vcm = stage.vcm(0.1f);
    render(stage.camera, vcm, film, options);
    return film.mean();
  };
  const Image one = image(1), two = image(2), seven = image(7);
  CHECK(std::memcmp(one.pixels.data(), two.pixels.data(), one.pixels.size() * sizeof(Rgb)) == 0);
  CHECK(std::memcmp(one.pixels.data(), seven.pixels.data(), one.pixels.size() * sizeof(Rgb)) == 0);
  const MergeRadius radius{2, 0.5f};
  CHECK(radius.at(0) == 2);
  CHECK(radius.at(15) == Approx(1));
}

TEST_CASE("vcm: all photons within the radius are found, once") {
  Rng rng(3);
  std::vector<Photon> photons;
  const PartialWeights none = PartialWeights::fromCamera(1, 1, 0);
  for (int i = 0; i < 2000; ++i) {
    const float x = rng.uniform(), y = rng.uniform();
    photons.push_back(
        {Vec3(x, y, rng.uniform()) - Vec3::Constant(0.5f), Vec3::UnitZ(), Vec3::UnitZ(), grey(1), none, i, false});
  }
  const float radius = 0.08f;
  const PhotonGrid grid(photons, radius);
  for (int q = 0; q < 200; ++q) {
    const Vec3 centre = photons[static_cast<std::size_t>(q)].position + Vec3::Constant(0.03f);
    std::vector<int> found, expected;
    grid.forEachNear(centre, [&](const Photon& photon) { found.push_back(photon.depth); });
    for (const Photon& photon : photons)
      if ((photon.position - centre).norm() <= radius) expected.push_back(photon.depth);
    std::ranges::sort(found);
    CHECK(found == expected);
  }
}

TEST_CASE("bidirectional: the image depends on the seed but not on threads or waves") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto image = [&](int threads, std::uint64_t seed, int first, int samples) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    Film film(stage.camera.width(), stage.camera.height());
    RenderOptions options;
    options.seed = seed, options.samples = samples, options.firstSample = first;
    BdptIntegrator bdpt = stage.bdpt();
    render(stage.camera, bdpt, film, options);
    return film.mean();
  };
  const auto equal = [](const Image& a, const Image& b) {
    return std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Rgb)) == 0;
  };
  const Image one = image(1, 5, 0, 8);
  CHECK(equal(one, image(2, 5, 0, 8)));
  CHECK(equal(one, image(7, 5, 0, 8)));
  CHECK_FALSE(equal(one, image(1, 6, 0, 8)));
  // The parts of an image are those of the whole.
  const Image first = image(2, 5, 0, 4), second = image(2, 5, 4, 4);
  for (std::size_t i = 0; i < one.pixels.size(); ++i)
    CHECK((0.5f * (first.pixels[i] + second.pixels[i]) - one.pixels[i]).abs().maxCoeff() < 1e-5f);
}

TEST_CASE("bidirectional: light paths of the border around the image make no contributions of their own") {
  Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto traced = [&](const BidirectionalIntegrator& integrator, std::vector<Splat>* splats) {
    PathStatistics statistics;
    Rgb sum = Rgb::Zero();
    for (int i = 0; i < 300; ++i) {
      Sampler rng(1, 0, i), lightRng(1, 1, i);
      const Ray ray = stage.camera.sample(i % 20, i / 20, rng);
      sum += integrator.radiance(ray, rng, lightRng, statistics, splats);
    }
    return std::pair(sum, statistics.rays());
  };
  const auto check = [&](const BidirectionalIntegrator& integrator) {
    std::vector<Splat> splats;
    const auto [inImage, rays] = traced(integrator, &splats);
    CHECK_FALSE(splats.empty());
    const auto [inBorder, fewer] = traced(integrator, nullptr);
    CHECK((inImage == inBorder).all());
    CHECK(fewer < rays);
  };
  check(stage.bdpt());
  check(stage.pathWithLight());
}

TEST_CASE("bidirectional: the light image has one light path for each pixel, and none of the border") {
  class Counting : public BidirectionalIntegrator {
   public:
    Rgb radiance(const Ray&, Sampler&, Sampler&, PathStatistics&, std::vector<Splat>* splats) const override {
      ++(splats ? inImage : inBorder);
      return Rgb::Zero();
    }
    mutable std::atomic<int> inImage = 0, inBorder = 0;
  };
  Camera camera;
  camera.width = 40, camera.height = 30;
  Film film(40, 30);
  RenderOptions options;
  options.samples = 1;
  Counting integrator;
  render(RayCamera(camera, PixelFilter{PixelFilter::Kind::tent, 1.0f}), integrator, film, options);
  CHECK(integrator.inImage.load() == 40 * 30);
  CHECK(integrator.inBorder.load() == 42 * 32 - 40 * 30);
}

namespace {

/// Sets the flag after a number of camera paths, like a signal at a random moment.
template <class Inner>
class Stopping : public Inner {
 public:
  Stopping(const Inner& inner, int paths, StopFlag& flag) : Inner(inner), left_(paths), flag_(flag) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override {
    if (--left_ == 0) flag_ = 1;
    return Inner::radiance(ray, rng, lightRng, statistics, splats);
  }

 private:
  mutable std::atomic<int> left_;
  StopFlag& flag_;
};

template <class AnyIntegrator>
void checkStopping(const Stage& stage, AnyIntegrator integrator) {
  RenderOptions options;
  options.samples = 9, options.firstSample = 3;
  Film whole(stage.camera.width(), stage.camera.height());
  const RenderResult uninterrupted = render(stage.camera, integrator, whole, options);
  const int pixels = stage.camera.width() * stage.camera.height();
  for (const int moment : {1, pixels, 2 * pixels + 1, 5 * pixels - 7, 9 * pixels - 1}) {
    StopFlag stop = 0;
    options.stop = &stop;
    Film film(stage.camera.width(), stage.camera.height());
    Stopping<AnyIntegrator> stopping(integrator, moment, stop);
    const RenderResult part = render(stage.camera, stopping, film, options);
    // The sample in which the flag is set is completed.
    const int expected = (moment + pixels - 1) / pixels;
    CHECK(film.sampleRange() == std::pair(static_cast<std::uint32_t>(expected), static_cast<std::uint32_t>(expected)));
    CHECK(part.total.samples == expected);
    stop = 0;
    const RenderResult result = render(stage.camera, integrator, film, options, {}, part);
    CHECK_FALSE(result.stopped);
    CHECK(result.total.samples == 9);
    CHECK(result.statistics.paths == uninterrupted.statistics.paths);
    CHECK(result.statistics.rays() == uninterrupted.statistics.rays());
    CHECK(std::ranges::equal(film.pixels(), whole.pixels(), [](const Film::Pixel& p, const Film::Pixel& q) {
      return std::memcmp(&p, &q, sizeof p) == 0;
    }));
  }
}

}  // namespace

TEST_CASE("bidirectional: stopped at any moment and continued, an image has the same bytes") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  checkStopping(stage, stage.bdpt());
  // The radius shrinks with the index of the sample.
  checkStopping(stage, VcmIntegrator(stage.ready, stage.camera, stage.options, {0.3f, 0.5f}));
}

TEST_CASE("light paths: light that next-event estimation sees through surfaces gives the image of path tracing",
          "[slow]") {
  const auto [name, material] = GENERATE(table<std::string, std::string>(
      {{"slab", R"(<bsdf type="dielectric"/>)"},
       {"panes", R"(<bsdf type="thindielectric"/>)"},
       {"mask", R"(<bsdf type="mask"><float name="opacity" value="0.4"/><bsdf type="roughplastic"/></bsdf>)"},
       {"blend", R"(<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="dielectric"/>
          <bsdf type="diffuse"/></bsdf>)"}}));
  CAPTURE(name);
  const std::string slab =
      "<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"3\" y=\"3\" z=\"0.1\"/>"
      "<rotate x=\"1\" angle=\"15\"/><translate z=\"2.6\"/></transform>" +
      material + "</shape>";
  const std::string point = R"(<emitter type="point"><point name="position" x="1" y="-1" z="4"/>
    <rgb name="intensity" value="3, 2, 1"/></emitter>)";
  const std::string lamp = R"(<shape type="sphere"><point name="center" x="1" y="0" z="4"/>
    <float name="radius" value="0.4"/><emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>)";
  // All but the environment is in water, where light has another solid angle than outside.
  const std::string water = R"(<shape type="cube"><transform name="to_world"><scale x="9" y="9" z="4"/>
    <translate z="3.5"/></transform><bsdf type="dielectric"><float name="int_ior" value="1.33"/></bsdf></shape>)";
  const bool wet = GENERATE(false, true);
  // Only light paths find a point light behind surfaces that refract.
  const bool straight = name == "panes" || name == "mask";
  Scene scene = sceneWith(kFloor + slab + lamp + (straight && !wet ? point : "") + (wet ? water : ""));
  scene.environment = brightSpot();
  Stage stage(std::move(scene));
  SECTION("to any depth") {}
  SECTION("to a depth") {
    stage.options.maxDepth = 4;
  }
  const auto path = renderBlocks(stage, stage.path(), {48, 48, 1});
  CHECK(agree(path, renderBlocks(stage, stage.pathWithLight(), {48, 24, 2000})));
}

TEST_CASE("light paths: light whose solid angle a refracting surface changes gives the image of path tracing") {
  // Camera and walls are in glass. Next-event estimation finds the environment through its surface, about as often as
  // light paths.
  Scene scene = sceneWith(std::string(kFloor) + R"(<shape type="cube"><transform name="to_world">
    <scale x="8" y="8" z="2"/><translate z="1"/></transform><bsdf type="dielectric"/></shape>)");
  scene.environment = brightSpot();
  const Stage stage(std::move(scene));
  const auto path = renderBlocks(stage, stage.path(), {48, 32, 1});
  CHECK(agree(path, renderBlocks(stage, stage.pathWithLight(4), {48, 12, 2000})));
}

TEST_CASE("light paths: light of delta lights through glass gives the image of bidirectional path tracing") {
  // Camera paths do not find it. The camera does not see the slab, through which it would see light that only
  // connections find.
  const auto [name, light] = GENERATE(table<std::string, std::string>(
      {{"directional", R"(<emitter type="directional"><vector name="direction" x="-0.3" y="0.4" z="-2"/>
          <rgb name="irradiance" value="3, 2, 2.5"/></emitter>)"},
       {"point", R"(<emitter type="point"><point name="position" x="1" y="-1" z="5"/>
          <rgb name="intensity" value="90, 80, 70"/></emitter>)"},
       {"spot", R"(<emitter type="spot"><transform name="to_world"><lookat origin="1, -1, 5" target="0.5, 0, 0"
          up="0, 1, 0"/></transform><float name="cutoff_angle" value="35"/><rgb name="intensity" value="90, 80, 70"/>
          </emitter>)"}}));
  CAPTURE(name);
  const Stage stage(sceneWith(kFloor + light + R"(<shape type="cube"><transform name="to_world">
    <scale x="3" y="3" z="0.1"/><translate z="3.5"/></transform><bsdf type="dielectric"/></shape>)"));
  const auto bdpt = renderBlocks(stage, stage.bdpt(), {48, 12, 1});
  CHECK(agree(bdpt, renderBlocks(stage, stage.pathWithLight(), {48, 12, 1000})));
  CHECK(agree(bdpt, renderBlocks(stage, stage.pathWithLight(0.25), {48, 24, 2000})));
}

TEST_CASE("light paths: guided emission of the environment gives the image of path tracing") {
  Scene scene = sceneWith(std::string(kFloor) + kLamp + R"(<shape type="sphere">
    <point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.9"/><bsdf type="dielectric"/></shape>)");
  scene.environment = brightSpot();
  Stage stage(std::move(scene));
  // Photons start on the disc of the whole scene, or of a part of it.
  if (GENERATE(false, true)) stage.ready.lights.focus({Vec3(-0.6f, -1.4f, -0.1f), Vec3(1.9f, 1, 1.9f)});
  // Learns from where light comes to a few points.
  EnvironmentGuide guide(stage.ready.lights);
  Rng rng(3);
  for (int i = 0; i < 3000; ++i) {
    const Vec3 point(3 * rng.uniform() - 1, 3 * rng.uniform() - 2, 0);
    const auto from = stage.ready.lights.environment()->sample(rng.uniform2());
    if (from && from->wi.z() > 0) guide.learn(point, from->wi, rng.uniform());
  }
  guide.update();
  const PhotonEmission emission(stage.ready.lights, &guide);
  // The density is that of the samples, except where rounding chooses the bin on the other side of a border.
  int found = 0, equal = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto photon = guide.sample(rng.uniformDouble(), rng.uniform2(), rng.uniform2());
    if (!photon) continue;
    const Vec3 point = photon->ray.origin + 2.5f * photon->ray.direction;
    ++found;
    if (std::abs(guide.density(point, -photon->ray.direction) / photon->density - 1) < 1e-3f) ++equal;
  }
  CHECK(found > 500);
  CHECK(equal > 0.98 * found);
  const auto path = renderBlocks(stage, stage.path(), {48, 160, 1});
  const PathWithLight<> guided(stage.ready, stage.camera, stage.options, {0.5, emission});
  CHECK(agree(path, renderBlocks(stage, guided, {48, 24, 2000})));
}

TEST_CASE("bidirectional: lights chosen by their power in a part of the scene give the image of path tracing") {
  const std::string light = GENERATE(std::string(), std::string(R"(<emitter type="directional"><vector name="direction"
    x="-0.3" y="0.4" z="-2"/><rgb name="irradiance" value="3, 2, 2.5"/></emitter>)"));
  Scene scene = sceneWith(std::string(kFloor) + kLamp + light);
  if (light.empty()) scene.environment = brightSpot();
  Stage stage(std::move(scene));
  stage.ready.lights.focus({Vec3(-0.6f, -1.4f, -0.1f), Vec3(1.9f, 1, 1.9f)});
  REQUIRE(stage.ready.lights.region().diagonal() < 0.9f * stage.ready.tracer.bounds().diagonal().norm());
  CHECK(agreesWithPath(stage));
}

TEST_CASE("bidirectional: a choice of lights that depends on the place gives the image of path tracing") {
  // Each part of the room has a lamp of its own, so that the learnt probabilities differ between neighbours.
  std::string lamps;
  for (const float x : {-2.5f, -1.0f, 0.5f, 2.0f})
    lamps += fmt::format(R"(<shape type="sphere"><point name="center" x="{}" y="{}" z="0.6"/>
      <float name="radius" value="0.15"/><emitter type="area"><rgb name="radiance" value="30, 25, 20"/></emitter></shape>
      <emitter type="point"><point name="position" x="{}" y="1" z="0.5"/><rgb name="intensity" value="0.6, 0.5, 0.7"/>
      </emitter>)",
                         x, -1 - 0.2f * x, x + 0.7f);
  const Stage stage(sceneWith(kFloor + lamps));
  const auto probabilityAt = [&](float x) {
    return stage.ready.lights.at(LightReceiver{Vec3(x, -1, 0), Vec3::UnitZ()}).probability(0);
  };
  REQUIRE(probabilityAt(-2.5f) > 2 * probabilityAt(2));
  CHECK(agreesWithPath(stage));
}

namespace {

/// Samples like the BSDF, and reports a density that is wrong by a factor.
struct WrongGuide {
  float fault;
  class Vertex {
   public:
    Vertex(const WrongGuide& guide, const SurfaceHit& hit) : fault_(guide.fault), right_(BsdfSampler(), hit) {}
    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const {
      auto sample = right_.sample(rng, statistics);
      if (sample) sample->pdf *= fault_;
      return sample;
    }
    float pdf(const Vec3& wi) const { return fault_ * right_.pdf(wi); }
    static std::optional<VertexEstimate> estimate() { return std::nullopt; }

   private:
    float fault_;
    BsdfSampler::Vertex right_;
  };
};

class WrongBdpt : public BidirectionalIntegrator {
 public:
  WrongBdpt(const Stage& stage, float camera, float light) : stage_(stage), camera_{camera}, light_{light} {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override {
    return BidirectionalPaths(stage_.ready, stage_.camera, stage_.options, camera_, light_)
        .radiance(ray, rng, lightRng, statistics, splats);
  }

 private:
  const Stage& stage_;
  WrongGuide camera_, light_;
};

}  // namespace

TEST_CASE("bidirectional: a wrong density of either subpath is detected") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto path = renderBlocks(stage, stage.path(), {48, 24, 1});
  CHECK(agree(path, renderBlocks(stage, WrongBdpt(stage, 1, 1), {48, 12, 1000})));
  CHECK_FALSE(agree(path, renderBlocks(stage, WrongBdpt(stage, 1.2f, 1), {48, 12, 1000})));
  CHECK_FALSE(agree(path, renderBlocks(stage, WrongBdpt(stage, 1, 1.2f), {48, 12, 1000})));
}

TEST_CASE("light paths: a wrong density of any technique is detected") {
  // The ball makes caustics; the environment is sampled through it, too.
  const Stage stage(sceneWith(std::string(kFloor) + kLamp + R"(
    <shape type="sphere"><point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.9"/>
      <bsdf type="dielectric"/></shape>
    <emitter type="constant"><rgb name="radiance" value="0.3, 0.3, 0.3"/></emitter>)"));
  const auto path = renderBlocks(stage, stage.path(), {48, 160, 1});
  const LightTracing tracing{1, PhotonEmission(stage.ready.lights)};
  using Wrong = PathWithLight<WrongGuide, WrongGuide>;
  const auto blocksOf = [&](float camera, float light) {
    return renderBlocks(stage, Wrong(stage.ready, stage.camera, stage.options, tracing, {camera}, {light}),
                        {48, 24, 1000});
  };
  CHECK(agree(path, blocksOf(1, 1)));
  CHECK_FALSE(agree(path, blocksOf(1.2f, 1)));
  CHECK_FALSE(agree(path, blocksOf(1, 2.0f)));
}

TEST_CASE("bidirectional: the density of a camera is the inverse of the area that a pixel covers") {
  Camera camera;
  camera.width = 20, camera.height = 15;
  camera.kind = GENERATE(Camera::Kind::perspective, Camera::Kind::thinlens, Camera::Kind::orthographic);
  camera.apertureRadius = 0.3f, camera.focusDistance = 2;
  camera.toWorld.topLeftCorner<3, 3>() =
      Eigen::AngleAxisf(0.4f, Vec3(1, 2, 3).normalized()).toRotationMatrix() * Eigen::Scaling(1.5f, 1.0f, 2.0f);
  camera.toWorld.topRightCorner<3, 1>() = Vec3(3, -1, 2);
  const RayCamera rays(camera, {});
  const Vec2 lens(0.3f, -0.5f), film(13.2f, 4.7f);
  const Ray ray = rays.rayThrough(film, lens);
  const float distance = 4;
  const Vec3 point = ray.origin + distance * ray.direction;
  const auto view = rays.view(point, lens);
  REQUIRE(view);
  CHECK((view->film - film).norm() < 1e-3f);
  CHECK(view->ray.direction.isApprox(ray.direction, 1e-5f));
  CHECK(view->ray.tfar == Approx(distance).epsilon(1e-4));
  // Where the rays through nearby image points meet the plane through the point, perpendicular to the ray.
  const auto meet = [&](const Vec2& p) {
    const Ray r = rays.rayThrough(p, lens);
    return Vec3(r.origin + r.direction * ((point - r.origin).dot(ray.direction) / r.direction.dot(ray.direction)));
  };
  const float h = 0.05f;
  const Vec3 dx = (meet(film + Vec2(h, 0)) - meet(film - Vec2(h, 0))) / (2 * h);
  const Vec3 dy = (meet(film + Vec2(0, h)) - meet(film - Vec2(0, h))) / (2 * h);
  CHECK(view->density == Approx(1 / dx.cross(dy).norm()).epsilon(1e-2));
  CHECK(rays.density(ray, distance) == Approx(view->density).epsilon(1e-4));
}
