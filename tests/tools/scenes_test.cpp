// Rendered images confirm how parameters of a scene file are interpreted.

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "runtime/image/image.h"
#include "tests/support/json.h"
#include "tests/support/loberender_test_tools.h"

namespace lobe::test {
namespace {

/// A camera at z = 5 that looks along −z, with additional parameters.
std::string sensor(const std::string& parameters) {
  return R"(<sensor type="perspective"><float name="fov" value="20"/>)" + parameters +
         R"(<transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
            <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>
            <rfilter type="box"/></film></sensor>)";
}

std::string rectangle(double z, const std::string& content) {
  return fmt::format(R"(<shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="{}"/>
                        </transform>{}</shape>)",
                     z, content);
}

std::string lamp(double radiance) {
  return fmt::format(R"(<emitter type="area"><rgb name="radiance" value="{}"/></emitter>)", radiance);
}

const std::string kBlack = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>)";

/// The mean of the red channel.
double meanOf(const std::string& version, const std::string& body, const std::string& options = "") {
  const SceneFolder folder(false);
  folder.write("scene.xml", "<scene version=\"" + version + "\">" + body + "</scene>");
  const ToolRun run = folder.run("loberender scene.xml --integrator path --spp 16 -o a.exr " + options);
  CAPTURE(run.error);
  REQUIRE(run.code == 0);
  double sum = 0;
  const Image image = readImage(folder / "a.exr");
  for (const Rgb& pixel : image.pixels) sum += pixel.x();
  return sum / static_cast<double>(image.pixels.size());
}

}  // namespace

TEST_CASE("loberender: max_depth of the scene applies unless the command line overrides it") {
  const auto scene = [](int depth) {
    return fmt::format(R"(<integrator type="path"><integer name="max_depth" value="{}"/></integrator>{}{}
                          <emitter type="constant"/>)",
                       depth, sensor(""), rectangle(0, R"(<bsdf type="diffuse"/>)"));
  };
  CHECK(meanOf("3.0.0", scene(1)) == 0);  // the floor fills the image
  CHECK(meanOf("3.0.0", scene(0)) == 0);
  CHECK(meanOf("3.0.0", scene(2)) == Approx(0.5).epsilon(0.05));
  CHECK(meanOf("3.0.0", scene(1), "--max-depth 2") == Approx(0.5).epsilon(0.05));
  CHECK(meanOf("3.0.0", scene(2), "--max-depth 1") == 0);
}

TEST_CASE("loberender: geometry nearer than near_clip or beyond far_clip is invisible") {
  const std::string planes = rectangle(3, kBlack) + rectangle(0, lamp(1));
  CHECK(meanOf("3.0.0", sensor("") + planes) == 0);
  CHECK(meanOf("3.0.0", sensor(R"(<float name="near_clip" value="3"/>)") + planes) == 1);
  CHECK(meanOf("3.0.0", sensor(R"(<float name="near_clip" value="1.99"/>)") + planes) == 0);
  const std::string behind = planes + R"(<emitter type="constant"><rgb name="radiance" value="7"/></emitter>)";
  CHECK(meanOf("3.0.0", sensor(R"(<float name="far_clip" value="1.99"/>)") + behind) == Approx(7));
  CHECK(meanOf("3.0.0", sensor(R"(<float name="near_clip" value="3"/><float name="far_clip" value="4.99"/>)") +
                            behind) == Approx(7));
}

TEST_CASE("loberender: hide_emitters hides lamps from the camera but not their light") {
  // A lamp with reflectance 0.5 in front of a black wall, in uniform light of 1.
  const std::string scene = sensor("") + rectangle(1, R"(<bsdf type="diffuse"/>)" + lamp(5)) + rectangle(0, kBlack) +
                            R"(<emitter type="constant"/>)";
  const std::string hide = R"(<integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>)";
  CHECK(meanOf("3.0.0", scene) == Approx(5.5).epsilon(0.03));
  // Before version 2 the lamp is visible as a surface in uniform light.
  CHECK(meanOf("0.6.0", hide + scene) == Approx(0.5).epsilon(0.03));
  CHECK(meanOf("3.0.0", hide + scene) == 0);  // the black wall behind it
  CHECK(
      meanOf("3.0.0", hide + sensor("") + R"(<emitter type="constant"/><shape type="sphere"><point name="center" z="99"
        x="0" y="0"/></shape>)") == 0);
  // Its light on other surfaces remains: a mirror shows the lamp behind the camera.
  const std::string mirror = sensor("") + rectangle(0, R"(<bsdf type="conductor"/>)") +
                             R"(<shape type="rectangle"><transform name="to_world"><scale value="9"/>
                                <rotate y="1" angle="180"/><translate z="9"/></transform>)" +
                             lamp(3) + "</shape>";
  CHECK(meanOf("3.0.0", hide + mirror) == Approx(3));
}

TEST_CASE("loberender: a file name that differs only in case is found next to a scene given without its folder") {
  const SceneFolder folder(false);
  folder.write("Ball.xml", R"(<scene version="3.0.0"><shape type="sphere"/></scene>)");
  folder.write("scene.xml", "<scene version=\"3.0.0\">" + sensor("") + R"(<include filename="ball.XML"/></scene>)");
  const ToolRun run = folder.run("loberender --check scene.xml");
  CHECK(run.code == 0);
  CHECK_THAT(run.out, Catch::Contains("Ball.xml is used instead"));
}

TEST_CASE("loberender and lobefit: --check reports all faults and renders nothing") {
  const SceneFolder folder(false);
  folder.write("scene.xml", "<scene version=\"3.0.0\">\n" + sensor("") + R"(<integrator type="volpath"/>
    <shape type="torus"/><shape type="sphere"><bsdf type="velvet"/></shape></scene>)");
  ToolRun run = folder.run("loberender --check scene.xml");
  CHECK(run.code == 1);
  CHECK_THAT(run.out, Catch::Contains("\"torus\"") && Catch::Contains("\"velvet\"") && Catch::Contains("note: "));
  CHECK(run.error == "loberender: error: scene.xml: 2 faults\n");
  run = folder.run("loberender --check scene.xml --json");
  CHECK(run.code == 1);
  const auto json = parseJson(run.out);
  CHECK(json["readable"] == false);
  CHECK(json["faults"].size() == 2);
  CHECK(json["faults"][0]["with_lenient"] == "the shape is left out");
  run = folder.run("loberender --check --lenient scene.xml");
  CHECK(run.code == 0);
  CHECK_THAT(run.out, Catch::Contains("scene.xml can be read"));
  run = folder.run("lobefit --check scene.xml");
  CHECK(run.code == 1);
  run = folder.run("lobefit --check --lenient scene.xml --json");
  CHECK(run.code == 0);
  CHECK(parseJson(run.out)["readable"] == true);
  CHECK(folder.names() == std::set<std::string>{"scene.xml"});
}

TEST_CASE("loberender: a scene with several faults gives one line for each") {
  const SceneFolder folder(false);
  folder.write("scene.xml", "<scene version=\"3.0.0\">" + sensor("") + R"(<shape type="torus"/><gizmo/></scene>)");
  const ToolRun run = folder.run("loberender scene.xml -o a.exr --spp 1 --integrator path");
  CHECK(run.code == 1);
  CHECK(lineCount(run.error) == 3);
  CHECK_THAT(run.error, Catch::Contains("loberender: error: 2 faults of 2 kinds; --lenient reads what can be read"));
  CHECK(!folder.has("a.exr"));
}

}  // namespace lobe::test
