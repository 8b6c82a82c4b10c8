// The hash that identifies the scene of trained illumination.

#include <catch2/catch.hpp>

#include "scenes/scene_hash.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;

namespace {

const std::string kBody = R"(
<bsdf type="twosided" id="wood"><bsdf type="roughconductor"><float name="alpha" value="0.25"/>
  <string name="distribution" value="ggx"/></bsdf></bsdf>
<bsdf type="diffuse" id="cloth"><texture type="checkerboard" name="reflectance"><rgb name="color0" value="0.1"/>
  <texture type="bitmap" name="color1"><string name="filename" value="a.tga"/></texture></texture></bsdf>
<shape type="obj"><string name="filename" value="a.obj"/><ref id="wood"/></shape>
<shape type="sphere" id="ball"><point name="center" x="3" y="0" z="0"/><ref id="cloth"/></shape>
<shape type="disk"><ref id="cloth"/></shape>
<shape type="cylinder"><float name="radius" value="0.5"/><ref id="cloth"/></shape>
<shape type="shapegroup" id="group"><shape type="cube"><ref id="wood"/></shape></shape>
<shape type="instance"><ref id="group"/><transform name="to_world"><translate x="7"/></transform></shape>
<shape type="rectangle"><emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>
<emitter type="point"><point name="position" x="0" y="9" z="0"/></emitter>
<emitter type="spot"><float name="cutoff_angle" value="20"/><texture type="checkerboard"><float name="color0"
  value="0.75"/></texture></emitter>
<emitter type="projector"><rgb name="irradiance" value="0.625"/><float name="fov" value="44"/></emitter>
<emitter type="directional"><vector name="direction" x="0" y="0" z="-1"/></emitter>
<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>
)";

struct Files {
  std::string scene = sceneOf(kBody);
  std::string mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  /// Two pixels of 24 bits without compression.
  std::string image = std::string("\0\0\2\0\0\0\0\0\0\0\0\0\2\0\1\0\x18\0", 18).append("abcdef");

  void replace(const std::string& from, const std::string& to) {
    const std::size_t at = scene.find(from);
    REQUIRE(at != std::string::npos);
    scene.replace(at, from.size(), to);
  }
  std::uint64_t hash() const {
    const TestFolder folder;
    folder.write("a.obj", mesh);
    folder.write("a.tga", image);
    return lightHash(readScene(folder.write("test.xml", scene)));
  }
};

}  // namespace

TEST_CASE("scenes: the hash stays the same when neither shapes nor materials nor emitters change") {
  const std::uint64_t hash = Files().hash();
  CHECK(Files().hash() == hash);  // in another folder
  Files camera;
  camera.replace("value=\"40\"", "value=\"50\"");
  CHECK(camera.hash() == hash);
  Files name;
  name.replace("id=\"ball\"", "id=\"globe\"");
  CHECK(name.hash() == hash);
  Files integrator;
  integrator.replace("<bsdf", "<integrator type=\"path\"><integer name=\"max_depth\" value=\"5\"/></integrator><bsdf");
  CHECK(integrator.hash() == hash);
}

TEST_CASE("scenes: the hash changes with everything that determines the light transport") {
  const std::uint64_t hash = Files().hash();
  const std::vector<std::pair<std::string, std::string>> changes{
      {"0.25", "0.26"},                               // a nested material's parameter
      {"value=\"ggx\"", "value=\"beckmann\""},        // an enumeration value
      {"value=\"0.1\"", "value=\"0.2\""},             // a texture's colour
      {"<ref id=\"wood\"/>", "<ref id=\"cloth\"/>"},  // assignment of materials
      {"x=\"3\"", "x=\"3.0001\""},                    // a sphere
      {"type=\"disk\">", "type=\"disk\"><boolean name=\"flip_normals\" value=\"true\"/>"},
      {"value=\"0.5\"/><ref", "value=\"0.6\"/><ref"},        // a cylinder
      {"<translate x=\"7\"/>", "<translate y=\"7\"/>"},      // an instance
      {"<shape type=\"cube\">", "<shape type=\"sphere\">"},  // the instanced shape
      {"value=\"5\"", "value=\"6\""},                        // lights
      {"y=\"9\"", "y=\"8\""},
      {"value=\"20\"", "value=\"21\""},
      {"z=\"-1\"", "z=\"1\""},
      {"<rgb name=\"radiance\" value=\"0.5\"/>", "<rgb name=\"radiance\" value=\"0.5, 0.5, 0.6\"/>"},
      {"<string name=\"filename\" value=\"a.tga\"/>",
       "<string name=\"filename\" value=\"a.tga\"/><string name=\"wrap_mode\" value=\"clamp\"/>"},
      {"<string name=\"filename\" value=\"a.tga\"/>",
       "<string name=\"filename\" value=\"a.tga\"/><boolean name=\"raw\" value=\"true\"/>"}};
  for (const auto& [from, to] : changes) {
    CAPTURE(from, to);
    Files files;
    files.replace(from, to);
    CHECK(files.hash() != hash);
  }
  Files mesh;
  mesh.mesh[2] = '1';
  CHECK(mesh.hash() != hash);
  Files image;
  image.image.back() = 'x';
  CHECK(image.hash() != hash);
}
