// Faults in scene files: each is reported in one line with the exact location, the offending text and the known names.
// Lenient reading leaves out or replaces them.

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "tests/support/scenes_test_tools.h"

namespace lobe {
namespace {

/// The fault is at LINE:COLUMN and its message contains all the parts.
void checkFault(const std::string& fault, const std::string& place, std::initializer_list<std::string> parts) {
  INFO(fault);
  CHECK(fault.starts_with("test.xml:" + place + ": "));
  CHECK(fault.find('\n') == std::string::npos);
  for (const std::string& part : parts) {
    INFO(part);
    CHECK(fault.find(part) != std::string::npos);
  }
}

}  // namespace

TEST_CASE("scenes: malformed XML is reported with its location") {
  checkFault(faultOfText("<scene>\n  <shape type=\"obj\n</scene>\n"), "2:16", {"broken XML"});
  checkFault(faultOfText("<scene>\n  <shape></shapes>\n</scene>\n"), "2:12", {"broken XML", "mismatch"});
  checkFault(faultOfText(""), "1:1", {});
  checkFault(faultOfText("<mesh/>"), "1:1", {"<mesh>", "<scene>"});
  checkFault(faultOf("<shape type=\"disk\">\n some text</shape>"), "3:2", {"\"some\""});
}

TEST_CASE("scenes: a missing file is named") {
  const TestFolder folder;
  REQUIRE_THROWS_AS(readScene(folder.path() / "none.xml"), SceneError);
  CHECK_THROWS_WITH(readScene(folder.path() / "none.xml"), Catch::Contains("none.xml"));
  CHECK_THROWS_AS(readScene(folder.path()), SceneError);
}

TEST_CASE("scenes: unknown elements and types are reported with the known ones") {
  checkFault(faultOf("\t<bdsf type=\"diffuse\"/>"), "2:2", {"<bdsf>", "bsdf", "shape"});
  checkFault(faultOf("<shape type=\"disk\">\n  <flaot name=\"radius\" value=\"1\"/>\n</shape>"), "3:3",
             {"<flaot>", "shape \"disk\"", "float"});
  checkFault(faultOf("<shape type=\"disk\">\n  <bsdf type=\"velvet\"/>\n</shape>"), "3:3",
             {"\"velvet\"", "roughplastic", "diffuse"});
  checkFault(faultOf("\n <bsdf type=\"velvet\" id=\"NotUsed\"/>"), "3:2", {"\"velvet\""});
  checkFault(faultOf("<shape type=\"torus\"/>"), "2:1",
             {"\"torus\"", "cube, cylinder, disk, instance, obj, ply, rectangle, serialized, shapegroup, sphere"});
  checkFault(faultOf("<emitter type=\"laser\"/>"), "2:1",
             {"\"laser\"", "area, constant, directional, envmap, point, projector, sky, spot, sun, sunsky"});
  checkFault(faultOf("<emitter type=\"area\"/>"), "2:1", {"inside a shape"});
  checkFault(faultOf("<shape type=\"disk\"><emitter type=\"spot\"/></shape>"), "2:20", {"\"spot\"", "area"});
  checkFault(faultOf("<texture type=\"wood\"/>"), "2:1", {"\"wood\"", "bitmap, checkerboard, scale"});
  checkFault(faultOf("<shape/>"), "2:1", {"type"});
  checkFault(faultOfText("<scene><sensor type=\"fisheye\"/></scene>"), "1:8",
             {"\"fisheye\"", "perspective, thinlens, orthographic"});
  checkFault(faultOf("<shape type=\"disk\"><transform name=\"to_world\"><shear/></transform></shape>"), "2:47",
             {"<shear>", "translate, scale, rotate, lookat, matrix"});
  checkFault(faultOfText("<scene/>"), "1:1", {"sensor"});
}

TEST_CASE("scenes: unknown parameters are reported with their element") {
  checkFault(faultOf("<bsdf type=\"roughplastic\">\n\t<float name=\"foo\" value=\"1\"/>\n</bsdf>"), "3:2",
             {"\"foo\"", "bsdf \"roughplastic\""});
  checkFault(faultOf("<shape type=\"disk\">\n<float name=\"radius\" value=\"1\"/></shape>"), "3:1",
             {"\"radius\"", "shape \"disk\""});
  checkFault(faultOf("<emitter type=\"constant\"><float name=\"power\" value=\"1\"/></emitter>"), "2:26",
             {"\"power\""});
  checkFault(faultOf("<texture type=\"checkerboard\"><float name=\"size\" value=\"1\"/></texture>"), "2:30",
             {"\"size\""});
  checkFault(
      faultOfText(
          "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"zoom\" value=\"1\"/></sensor></scene>"),
      "1:51", {"\"zoom\""});
  checkFault(faultOf("<shape type=\"disk\"><boolean name=\"flip_normals\" value=\"true\" vale=\"\"/></shape>"), "2:20",
             {"vale", "name, value"});
}

TEST_CASE("scenes: invalid values are reported with their text") {
  const auto fault = [](const std::string& element) {
    return faultOf("<bsdf type=\"roughplastic\">\n  " + element + "</bsdf>");
  };
  checkFault(fault("<float name=\"alpha\" value=\"0.1x\"/>"), "3:3", {"\"0.1x\"", "alpha"});
  checkFault(fault("<float name=\"alpha\" value=\"\"/>"), "3:3", {"alpha"});
  checkFault(fault("<float name=\"alpha\" value=\"nan\"/>"), "3:3", {"nan"});
  checkFault(fault("<float name=\"alpha\" value=\"-1\"/>"), "3:3", {"alpha", "-1"});
  checkFault(fault("<boolean name=\"nonlinear\" value=\"yes\"/>"), "3:3", {"\"yes\"", "true or false"});
  checkFault(fault("<rgb name=\"diffuse_reflectance\" value=\"1, 2\"/>"), "3:3", {"\"1, 2\""});
  checkFault(fault("<string name=\"alpha\" value=\"rough\"/>"), "3:3", {"alpha"});
  checkFault(fault("<string name=\"distribution\" value=\"blinn\"/>"), "3:3", {"\"blinn\"", "beckmann, ggx"});
  checkFault(fault("<spectrum name=\"diffuse_reflectance\" value=\"400:1, 400:2\"/>"), "3:3", {"400:1"});
  checkFault(faultOf("<shape type=\"sphere\"><float name=\"radius\" value=\"-2\"/></shape>"), "2:22", {"radius", "-2"});
  checkFault(faultOf("<shape type=\"sphere\"><transform name=\"to_world\"><scale x=\"2\"/></transform></shape>"),
             "2:22", {"shape \"sphere\""});
  checkFault(faultOf("<shape type=\"disk\"><transform name=\"to_world\"><translate x=\"a\"/></transform></shape>"),
             "2:47", {"\"a\""});
  checkFault(faultOf("<integrator type=\"path\"><integer name=\"max_depth\" value=\"deep\"/></integrator>"), "2:25",
             {"deep"});
  checkFault(
      faultOfText("<scene><sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" value=\"0\"/>"
                  "</film></sensor></scene>"),
      "1:56", {"width", "0"});
  checkFault(faultOfText("<scene><sensor type=\"perspective\"><float name=\"fov\" value=\"180\"/></sensor></scene>"),
             "1:35", {"180"});
  checkFault(faultOfText("<scene><sensor type=\"perspective\"><string name=\"focal_length\" value=\"long\"/></sensor>"
                         "</scene>"),
             "1:35", {"long", "50mm"});
}

TEST_CASE("scenes: invalid emitters are rejected") {
  const auto fault = [](const std::string& type, const std::string& body) {
    return faultOf("<emitter type=\"" + type + "\">\n  " + body + "</emitter>");
  };
  checkFault(fault("point", "<rgb name=\"intensity\" value=\"1 -2 3\"/>"), "3:3", {"intensity", "negative", "-2"});
  checkFault(fault("spot", "<float name=\"intensity\" value=\"-1\"/>"), "3:3", {"intensity", "negative"});
  checkFault(fault("directional", "<float name=\"irradiance\" value=\"-1\"/>"), "3:3", {"irradiance", "negative"});
  checkFault(fault("constant", "<float name=\"radiance\" value=\"-1\"/>"), "3:3", {"radiance", "negative"});
  checkFault(fault("envmap", "<float name=\"scale\" value=\"-1\"/>"), "3:3", {"scale", "negative"});
  checkFault(faultOf("<shape type=\"disk\"><emitter type=\"area\">\n<rgb name=\"radiance\" value=\"0 0 -1\"/></emitter>"
                     "</shape>"),
             "3:1", {"radiance", "negative", "-1"});
  checkFault(fault("spot", "<float name=\"cutoffAngle\" value=\"0\"/>"), "3:3", {"cutoff_angle", "180"});
  checkFault(fault("spot", "<float name=\"beamWidth\" value=\"25\"/>"), "3:3", {"beam_width", "20", "25"});
  checkFault(fault("point", "<texture name=\"intensity\" type=\"checkerboard\"/>"), "3:3", {"intensity", "colour"});
  checkFault(fault("directional", "<vector name=\"direction\" x=\"0\"/>"), "3:3", {"direction", "zero"});
  checkFault(fault("point", "<point name=\"position\" x=\"1\"/><transform name=\"toWorld\"/>"), "3:33",
             {"position", "to_world"});
  checkFault(fault("directional", "<vector name=\"direction\" x=\"1\"/><transform name=\"toWorld\"/>"), "3:35",
             {"direction", "to_world"});
  checkFault(fault("point", "<float name=\"power\" value=\"1\"/>"), "3:3", {"\"power\"", "intensity"});
}

TEST_CASE("scenes: emission over the limit is rejected, also that of products and of parts of a texture") {
  const auto fault = [](const std::string& type, const std::string& body) {
    return faultOf("<emitter type=\"" + type + "\">\n" + body + "</emitter>");
  };
  const auto number = [](const std::string& name, const std::string& value) {
    return "<float name=\"" + name + "\" value=\"" + value + "\"/>\n";
  };
  const auto texture = [&](const std::string& name, const std::string& value) {
    return "<texture name=\"" + name + "\" type=\"checkerboard\">" + number("color0", value) + number("color1", "0") +
           "</texture>";
  };
  const std::string limit = "over 1e+30";
  checkFault(fault("constant", number("radiance", "1e20") + number("scale", "1e20")), "4:1", {"radiance times", limit});
  CHECK(fault("constant", number("radiance", "1e15") + number("scale", "1e14")).empty());
  // The mean of the checkerboard is within the limit.
  checkFault(
      faultOf("<shape type=\"disk\"><emitter type=\"area\">\n" + texture("radiance", "1.5e30") + "</emitter></shape>"),
      "3:1", {"the largest radiance", limit});
  checkFault(fault("spot", texture("texture", "1e20") + number("intensity", "1e20")), "3:1",
             {"intensity times texture", limit});
  checkFault(fault("projector", number("scale", "1e20") + number("fov", "40") + texture("irradiance", "1e20")), "3:1",
             {"irradiance times scale", limit});
  const std::string noon = "<vector name=\"sunDirection\" y=\"1\"/>";
  for (const std::string type : {"sun", "sunsky"})
    checkFault(fault(type, number("scale", "1e30") + noon), "3:1", {"the radiance of the sun", limit});
  std::string suns;
  for (int i = 0; i < 30; ++i) suns += "<emitter type=\"sun\">" + number("scale", "3e25") + noon + "</emitter>";
  checkFault(faultOf(suns), "2:1", {"all skies and suns together", limit});
}

TEST_CASE("scenes: invalid skies are rejected") {
  const auto fault = [](const std::string& type, const std::string& body) {
    return faultOf("<emitter type=\"" + type + "\">\n  " + body + "</emitter>");
  };
  const std::string down = "<vector name=\"sunDirection\" x=\"1\" y=\"-1\"/>";
  for (const std::string type : {"sky", "sun", "sunsky"}) {
    checkFault(fault(type, down), "3:3", {"45.0 degrees below the horizon"});
    checkFault(fault(type, "<float name=\"hour\" value=\"23\"/>"), "3:3", {"below the horizon"});
    checkFault(fault(type, "<float name=\"turbidity\" value=\"11\"/>"), "3:3", {"turbidity", "1 to 10", "11"});
    checkFault(fault(type, "<float name=\"scale\" value=\"-1\"/>"), "3:3", {"scale", "negative"});
    checkFault(fault(type, "<float name=\"stretch\" value=\"3\"/>"), "3:3", {"stretch", "1 to 2"});
    checkFault(fault(type, "<integer name=\"month\" value=\"13\"/>"), "3:3", {"month", "1 to 12"});
    checkFault(fault(type, "<vector name=\"sunDirection\" y=\"1\"/><float name=\"hour\" value=\"9\"/>"), "3:38",
               {"sun_direction", "hour"});
    checkFault(fault(type, "<float name=\"haze\" value=\"1\"/>"), "3:3", {"\"haze\"", "turbidity"});
    checkFault(faultOf("<emitter type=\"constant\"/>\n<emitter type=\"" + type + "\"/>"), "3:1",
               {"second environment"});
    checkFault(faultOf("<emitter type=\"" + type + "\"/>\n<emitter type=\"constant\"/>"), "3:1",
               {"second environment"});
  }
  checkFault(fault("sunsky", "<float name=\"sunScale\" value=\"-1\"/>"), "3:3", {"sun_scale", "negative"});
  checkFault(fault("sun", "<float name=\"sunRadiusScale\" value=\"1e3\"/>"), "3:3", {"sun_radius_scale"});
  checkFault(fault("sunsky", "<boolean name=\"complex_sun\" value=\"true\"/>"), "3:3", {"complex_sun", "disc"});
  checkFault(fault("sky", "<boolean name=\"extend\" value=\"true\"/>"), "3:3", {"extend", "horizon"});
  CHECK(fault("sunsky", "<boolean name=\"complex_sun\" value=\"false\"/><boolean name=\"extend\" value=\"false\"/>") ==
        "");
}

TEST_CASE("scenes: invalid cameras and crops are rejected") {
  const auto fault = [](const std::string& type, const std::string& body) {
    return faultOfText("<scene version=\"3.0.0\"><sensor type=\"" + type + "\">\n" + body + "</sensor></scene>");
  };
  checkFault(fault("thinlens", ""), "1:24", {"aperture_radius"});
  checkFault(fault("thinlens", "<float name=\"apertureRadius\" value=\"-1\"/>"), "2:1", {"aperture_radius", "-1"});
  checkFault(
      fault("thinlens", "<float name=\"apertureRadius\" value=\"1\"/>\n<float name=\"focusDistance\" value=\"0\"/>"),
      "3:1", {"focus_distance", "0"});
  checkFault(fault("orthographic", "<float name=\"fov\" value=\"40\"/>"), "2:1", {"\"fov\""});
  const std::string film = "<film type=\"hdrfilm\"><integer name=\"width\" value=\"100\"/>\n";
  checkFault(fault("perspective", film + "<integer name=\"cropOffsetX\" value=\"100\"/></film>"), "3:1",
             {"crop_offset_x", "0 to 99"});
  checkFault(fault("perspective", film + "<integer name=\"cropWidth\" value=\"91\"/>"
                                         "<integer name=\"cropOffsetX\" value=\"10\"/></film>"),
             "3:1", {"crop_width", "1 to 90", "91"});
  // The limit is 2^28 pixels, of the crop if there is one.
  const auto sized = [&](int height, const std::string& crop) {
    return fault("perspective", "<film type=\"hdrfilm\"><integer name=\"width\" value=\"65536\"/>" +
                                    fmt::format("<integer name=\"height\" value=\"{}\"/>", height) + crop + "</film>");
  };
  CHECK(sized(4096, "") == "");
  checkFault(sized(4097, ""), "2:22", {"65536x4097", "at most 268435456 pixels"});
  CHECK(sized(65536, "<integer name=\"cropHeight\" value=\"4096\"/>") == "");
  checkFault(sized(65536, "<integer name=\"cropHeight\" value=\"5000\"/>"), "2:22", {"65536x5000"});
}

TEST_CASE("scenes: cameras and filters beyond the range of rays are rejected") {
  const auto fault = [](const std::string& type, const std::string& body) {
    return faultOfText("<scene version=\"3.0.0\"><sensor type=\"" + type + "\">\n" + body + "</sensor></scene>");
  };
  const auto number = [](const std::string& name, const std::string& value) {
    return "<float name=\"" + name + "\" value=\"" + value + "\"/>";
  };
  const auto scale = [](const std::string& value) {
    return "<transform name=\"to_world\"><scale " + value + "/></transform>";
  };
  const std::string limit = "over 1e+15 are not supported";
  checkFault(fault("perspective", number("principalPointOffsetX", "1e20")), "2:1",
             {"principal_point_offset_x", "10000"});
  checkFault(fault("perspective", number("principalPointOffsetY", "-1e20")), "2:1", {"principal_point_offset_y"});
  checkFault(fault("perspective", number("nearClip", "1e25")), "2:1", {"near_clip", limit});
  checkFault(fault("orthographic", scale("value=\"100\"") + "\n" + number("nearClip", "1e14")), "3:1",
             {"near_clip is 1e+16 in the world", limit});
  checkFault(fault("perspective", number("fov", "1e-40")), "2:1", {"field of view"});
  checkFault(fault("perspective", "<string name=\"focalLength\" value=\"1e-30mm\"/>"), "2:1", {"field of view"});
  for (const std::string type : {"perspective", "orthographic"}) {
    checkFault(fault(type, scale("value=\"1e30\"")), "2:1", {"a camera's scale", "1e+15"});
    checkFault(fault(type, scale("value=\"0\"")), "2:1", {"singular"});
    checkFault(fault(type, scale("value=\"1e-36\"")), "2:1", {"a camera's scale", "1e-35"});
    checkFault(fault(type, scale("x=\"0\"")), "2:1", {"singular"});
    CHECK(fault(type, scale("value=\"1e-30\"")) == "");
  }
  const std::string aperture = number("apertureRadius", "1") + "\n";
  checkFault(fault("thinlens", number("apertureRadius", "1e38")), "2:1", {"aperture_radius", limit});
  checkFault(fault("thinlens", aperture + number("focusDistance", "1e-44")), "3:1", {"focus_distance"});
  checkFault(fault("thinlens", aperture + number("focusDistance", "1e-7")), "2:1", {"aperture_radius", "1e+06"});
  const auto filter = [&](const std::string& type, const std::string& name, const std::string& value) {
    return fault("perspective", "<film type=\"hdrfilm\"><rfilter type=\"" + type + "\">\n" + number(name, value) +
                                    "</rfilter></film>");
  };
  checkFault(filter("box", "radius", "1e30"), "3:1", {"radius", "1e-06 to 100"});
  checkFault(filter("tent", "radius", "1e-30"), "3:1", {"radius", "1e-06 to 100"});
  checkFault(filter("gaussian", "stddev", "1e30"), "3:1", {"stddev", "1e-06 to 25"});
  checkFault(filter("lanczos", "lobes", "1e9"), "3:1", {"lobes"});
  checkFault(filter("mitchell", "B", "1e38"), "3:1", {"b must be from -100 to 100"});
}

TEST_CASE("scenes: missing and damaged files are reported with the scene and the file") {
  const TestFolder folder;
  const auto fault = [&](const std::string& body) {
    try {
      readScene(folder.write("test.xml", sceneOf(body)));
    } catch (const SceneError& error) {
      return std::string(error.what()).substr(folder.path().string().size() + 1);
    }
    return std::string();
  };
  folder.write("broken.ply", "ply\nformat ascii 1.0\n");
  folder.write("broken.png", "not a picture");
  checkFault(fault("<shape type=\"obj\">\n  <string name=\"filename\" value=\"no such.obj\"/></shape>"), "3:3",
             {(folder.path() / "no such.obj").string()});
  checkFault(fault("<shape type=\"ply\"><string name=\"filename\" value=\"broken.ply\"/></shape>"), "2:19",
             {"broken.ply"});
  checkFault(fault("<shape type=\"obj\"/>"), "2:1", {"filename"});
  const auto texture = [](const std::string& file) {
    return "<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\">\n <string name=\"filename\" "
           "value=\"" +
           file + "\"/></texture></bsdf>";
  };
  checkFault(fault(texture("none.png")), "3:2", {(folder.path() / "none.png").string()});
  checkFault(fault(texture("broken.png")), "3:2", {"broken.png"});
  checkFault(fault("<emitter type=\"envmap\"><string name=\"filename\" value=\"sky.exr\"/></emitter>"), "2:24",
             {"sky.exr"});
}

TEST_CASE("scenes: undefined names and references are reported") {
  checkFault(faultOf("<default name=\"b\" value=\"1\"/>\n<bsdf type=\"diffuse\">"
                     "<float name=\"reflectance\" value=\"$a\"/></bsdf>"),
             "3:22", {"$a", "defined are b"});
  checkFault(faultOf("<shape type=\"disk\">\n<ref id=\"Gold\"/></shape>"), "3:1", {"\"Gold\""});
  checkFault(faultOf("<bsdf type=\"diffuse\" id=\"A\"/>\n<bsdf type=\"diffuse\" id=\"A\"/>"), "3:1", {"\"A\"", ":2:1"});
}

TEST_CASE("scenes: invalid groups and instances are rejected") {
  const auto group = [](const std::string& inside) {
    return "<shape type=\"shapegroup\" id=\"g\">" + inside + "</shape>";
  };
  CHECK_THAT(faultOf("<shape type=\"instance\"/>"), Catch::Contains("2:1") && Catch::Contains("<ref> to a shapegroup"));
  CHECK_THAT(faultOf("<shape type=\"instance\"><shape type=\"cube\"/></shape>"), Catch::Contains("one shapegroup"));
  CHECK_THAT(faultOf(group("<shape type=\"sphere\"><emitter type=\"area\"/></shape>")), Catch::Contains("cannot emit"));
  CHECK_THAT(faultOf(group("<shape type=\"shapegroup\"/>")), Catch::Contains("plain shapes only"));
  CHECK_THAT(faultOf(group("<shape type=\"instance\"><ref id=\"g\"/></shape>") +
                     "<shape type=\"instance\"><ref id=\"g\"/></shape>"),
             Catch::Contains("2:33: shape \"instance\" inside a shapegroup"));
  CHECK_THAT(faultOf(group("") + "<shape type=\"instance\"><ref id=\"g\"/><transform name=\"toWorld\"><scale x=\"0\"/>"
                                 "</transform></shape>"),
             Catch::Contains("singular"));
  const auto scaled = [](const std::string& scale) {
    return "\n<shape type=\"instance\"><ref id=\"g\"/><transform name=\"toWorld\"><scale " + scale +
           "/></transform></shape>";
  };
  const std::string cubes =
      group("<shape type=\"cube\"/>") + scaled("value=\"1e16\"") + scaled("value=\"0.5\"") + scaled("x=\"1e-40\"");
  CHECK_THAT(faultOf(cubes), Catch::Contains("test.xml:3:") && Catch::Contains("over 1e+15") &&
                                 Catch::Contains("test.xml:5:1: ") && Catch::Contains("too flat"));
  CHECK(readBody(cubes, lenient()).shapes.size() == 1);
}

TEST_CASE("scenes: a cylinder of zero length is rejected") {
  CHECK_THAT(faultOf("<shape type=\"cylinder\">\n<point name=\"p1\" x=\"0\" y=\"0\" z=\"0\"/></shape>"),
             Catch::Contains("3:1") && Catch::Contains("must differ"));
}

TEST_CASE("scenes: lenient reading replaces unknown elements and warns once per kind") {
  const Scene scene = readBody(
      "<shape type=\"torus\"/><shape type=\"torus\"/>"
      "<shape type=\"sphere\" id=\"Kept\"><bsdf type=\"velvet\"><float name=\"fuzz\" value=\"1\"/></bsdf></shape>"
      "<shape type=\"obj\"><string name=\"filename\" value=\"none.obj\"/></shape>"
      "<shape type=\"disk\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" "
      "type=\"bitmap\">"
      "<string name=\"filename\" value=\"none.png\"/></texture></bsdf></bsdf>"
      "<float name=\"shine\" value=\"1\"/></shape>"
      "<emitter type=\"laser\"/><gizmo/>",
      lenient());
  REQUIRE(scene.shapes.size() == 2);
  CHECK(scene.shapes[0].name == "Kept");
  CHECK(std::holds_alternative<Disk>(scene.shapes[1].geometry));
  for (const Shape& shape : scene.shapes) {
    const BsdfPtr& bsdf = scene.materials.at(static_cast<std::size_t>(shape.material)).bsdf;
    CHECK((bsdf->albedo(Vec3::UnitZ(), Vec2(0, 0)) == 0.5f).all());
  }
  CHECK(scene.warnings.size() == 7);
  for (const std::string& warning : scene.warnings) CHECK(warning.find("test.xml:2:") != std::string::npos);
}

}  // namespace lobe
