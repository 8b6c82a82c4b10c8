// Path tracing with light paths estimates the same image as path tracing without them, or as bidirectional path tracing
// where camera paths do not find the light.

#include <cmath>
#include <string>

#include <catch2/catch.hpp>

#include "tests/support/bidirectional_test_tools.h"
#include "tests/support/render_test_tools.h"

using namespace lobe;
using namespace lobe::test;

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

TEST_CASE("light paths: light of delta lights through glass gives the image of bidirectional path tracing", "[heavy]") {
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

TEST_CASE("light paths: guided emission of the environment gives the image of path tracing", "[heavy]") {
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
