// Bidirectional path tracing, and path tracing with light paths, estimate the same image as path tracing for every kind
// of light, material and camera, and the closed form in a furnace.

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "tests/support/bidirectional_test_tools.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

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

TEST_CASE("bidirectional: an environment with a bright spot gives the image of path tracing") {
  Scene scene = sceneWith(kFloor);
  scene.environment = brightSpot();
  const Stage stage(std::move(scene));
  CHECK(agreesWithPath(stage));
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
  const Stage stage(std::move(scene));
  CHECK(agreesWithPath(stage));
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

TEST_CASE("bidirectional: the caustic of a glass ball under a small lamp is that of path tracing", "[heavy]") {
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

TEST_CASE("bidirectional: dark and hidden emitters and the maximum depth give the image of path tracing", "[heavy]") {
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

TEST_CASE("bidirectional: with a maximum depth of 0, the image of every integrator is black") {
  Stage stage(sceneWith(std::string(kFloor) + kLamp + R"(<emitter type="constant">
    <rgb name="radiance" value="0.5, 0.6, 0.7"/></emitter>)"));
  const auto isBlack = [&](auto integrator) {
    Film film(stage.camera.width(), stage.camera.height());
    RenderOptions options;
    options.samples = 4;
    render(stage.camera, integrator, film, options);
    return std::ranges::all_of(film.mean().pixels, [](const Rgb& pixel) { return (pixel == 0.0f).all(); });
  };
  CHECK_FALSE(isBlack(stage.bdpt()));
  stage.options.maxDepth = 0;
  CHECK(isBlack(stage.path()));
  CHECK(isBlack(stage.pathWithLight()));
  CHECK(isBlack(stage.bdpt()));
  CHECK(isBlack(stage.vcm(0.05f)));
}

TEST_CASE("bidirectional: the radiance in a furnace is emission over one minus albedo", "[heavy]") {
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
