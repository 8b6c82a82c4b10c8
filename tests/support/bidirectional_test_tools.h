#pragma once
// Parts of scenes for the tests of bidirectional path tracing, and its comparison with path tracing.

#include <cmath>
#include <string>
#include <utility>

#include <catch2/catch.hpp>

#include "tests/support/batches.h"
#include "tests/support/scenes_test_tools.h"

namespace lobe::test {

// Filters and cameras are tested apart from lights and materials.
inline constexpr const char* kCamera = R"(<sensor type="perspective"><float name="fov" value="50"/>
  <transform name="to_world"><lookat origin="0, -6, 2.5" target="0, 0, 0.9" up="0, 0, 1"/></transform>
  <film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="15"/>
  <rfilter type="box"/></film></sensor>)";

// A floor and a back wall, on which light paths end, with a small box.
inline constexpr const char* kFloor = R"(
  <bsdf type="diffuse" id="grey"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
  <bsdf type="twosided" id="glossy"><bsdf type="roughconductor"><string name="distribution" value="ggx"/>
    <float name="alpha" value="0.25"/></bsdf></bsdf>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/></transform><ref id="grey"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="90"/>
    <translate y="2.5"/></transform><ref id="glossy"/></shape>
  <shape type="cube"><transform name="to_world"><scale value="0.5"/><rotate z="1" angle="30"/>
    <translate x="-1.3" z="0.5"/></transform><ref id="glossy"/></shape>)";

inline constexpr const char* kLamp = R"(<shape type="rectangle">
  <transform name="to_world"><scale value="0.7"/><rotate x="1" angle="160"/><translate x="1" z="3"/></transform>
  <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>)";

inline Scene sceneWith(const std::string& body, const std::string& camera = kCamera) {
  return readText("<scene version=\"3.0.0\">" + body + camera + "</scene>");
}

/// Whether bidirectional path tracing, and path tracing with light paths, agree with path tracing on the scene.
inline bool agreesWithPath(const Stage& stage, int batches = 48, int samples = 12) {
  const auto path = renderBlocks(stage, stage.path(), {batches, 2 * samples, 1});
  double light = 0;
  for (const Block& block : path) light += block.mean;
  REQUIRE(light > 0);
  return agree(path, renderBlocks(stage, stage.bdpt(), {batches, samples, 1000})) &&
         agree(path, renderBlocks(stage, stage.pathWithLight(), {batches, samples, 2000}));
}

/// An environment with a broad bright spot above the back wall, in a scene in which +z is up.
inline Environment brightSpot() {
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

}  // namespace lobe::test
