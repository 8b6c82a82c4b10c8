// Variants of scene files written by exporters and by several versions of Mitsuba.

#include <limits>

#include <catch2/catch.hpp>

#include <ImfRgbaFile.h>

#include "tests/support/scenes_test_tools.h"

namespace lobe {
namespace {

const Vec3 kUp = Vec3::UnitZ();

std::string sceneOfVersion(const std::string& version, const std::string& body) {
  return "<scene version=\"" + version + "\">\n" + body + "\n" + kSensor + "\n</scene>\n";
}

/// The albedo of the first material at normal incidence.
Rgb albedoOf(const Scene& scene) {
  return scene.materials.at(0).bsdf->albedo(kUp, Vec2(0.25f, 0.25f));
}

/// An image with one row of grey pixels.
void writeGreyExr(const std::filesystem::path& path, const std::vector<float>& row) {
  std::vector<Imf::Rgba> pixels;
  for (const float value : row) pixels.emplace_back(value, value, value);
  const int width = static_cast<int>(row.size());
  Imf::RgbaOutputFile file(path.c_str(), width, 1, Imf::WRITE_RGB);
  file.setFrameBuffer(pixels.data(), 1, row.size());
  file.writePixels(1);
}

std::string sphere(const std::string& bsdf) {
  return "<shape type=\"sphere\">" + bsdf + "</shape>";
}

}  // namespace

TEST_CASE("scenes: a conductor without a material is copper for Mitsuba 0.6 and a mirror for Mitsuba 3") {
  for (const std::string type : {"conductor", "roughconductor"}) {
    const std::string body = sphere("<bsdf type=\"twosided\"><bsdf type=\"" + type + "\"/></bsdf>");
    for (const std::string version : {"2.0.0", "3.5.2"})
      CHECK(albedoOf(readText(sceneOfVersion(version, body))).isApprox(grey(1.0f)));
    for (const std::string version : {"0.4.0", "0.6.0"})
      CHECK(albedoOf(readText(sceneOfVersion(version, body))).z() < 0.6f);
    const std::string copper = sphere("<bsdf type=\"" + type + "\"><string name=\"material\" value=\"Cu\"/></bsdf>");
    CHECK(albedoOf(readBody(copper)).z() < 0.6f);
  }
  // With only η given, k is 1: ((η − 1)² + 1) / ((η + 1)² + 1), up to the refractive index of air.
  const Scene half = readBody(sphere("<bsdf type=\"conductor\"><rgb name=\"eta\" value=\"2, 2, 2\"/></bsdf>"));
  CHECK(albedoOf(half).x() == Approx(0.2f).epsilon(1e-3));
}

TEST_CASE("scenes: conductors are selected by material name") {
  const auto metal = [](const std::string& name) {
    const std::string material = "<string name=\"material\" value=\"" + name + "\"/>";
    return albedoOf(readBody(sphere("<bsdf type=\"conductor\">" + material + "</bsdf>")));
  };
  for (const std::string name : {"Na", "Ni_palik", "MgO", "SiC", "TiC", "VN_palik", "Te-e", "AlAs"}) {
    CAPTURE(name);
    CHECK((metal(name) > 0.03f).all());
    CHECK((metal(name) <= 1.0f).all());
  }
  CHECK((metal("Cu_palik") == metal("cu")).all());
}

TEST_CASE("scenes: colours out of range are rejected with their location") {
  const auto fault = [](const std::string& body) { return faultOf("\n" + body); };
  for (const std::string value : {"-0.5", "0.2, -0.1, 0.3"})
    CHECK_THAT(fault(sphere("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"" + value + "\"/></bsdf>")),
               Catch::StartsWith("test.xml:3:43: ") && Catch::Contains("reflectance must be finite and not negative"));
  const std::string radiance = "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"";
  for (const std::string value : {"-1", "1e31", "1, 2, 1e200"})
    CHECK_THAT(fault(radiance + value + "\"/></emitter>"),
               Catch::StartsWith("test.xml:3:26: ") && Catch::Contains("neither negative nor over 1e+30"));
}

TEST_CASE("scenes: spectra are converted to colours") {
  const auto colour = [](const std::string& element) {
    return albedoOf(readBody(sphere("<bsdf type=\"diffuse\">" + element + "</bsdf>")));
  };
  const auto spectrum = [&](const std::string& value) {
    return colour("<spectrum name=\"reflectance\" intent=\"reflectance\" value=\"" + value + "\"/>");
  };
  CHECK(spectrum("300:0.4 900:0.4").isApprox(grey(0.4f), 1e-5f));
  CHECK(spectrum("400:0.78, 500:0.78, 600:0.78, 700:0.78").isApprox(grey(0.78f), 0.01f));
  const Rgb red = spectrum("600:0, 601:0.5, 800:0.5");
  CHECK(red.x() > 0.3f);
  CHECK(red.y() < 0.1f);
  CHECK(red.z() < 0.02f);
  CHECK(colour("<rgb name=\"reflectance\" value=\"#ff8000\"/>").isApprox(Rgb(1, 0.2158605f, 0), 1e-4f));
  CHECK(colour("<xyz name=\"reflectance\" value=\"0.4753, 0.5, 0.5445\"/>").isApprox(grey(0.5f), 2e-3f));

  const TestFolder folder;
  folder.write("grey.spd", "# measured\n300 0.25\n 900\t0.25 # end\n");
  const auto body = [](const std::string& file) {
    return sceneOf("<bsdf type=\"diffuse\" id=\"a\"><spectrum name=\"reflectance\" filename=\"" + file +
                   "\"/></bsdf><shape type=\"disk\"><ref id=\"a\"/></shape>");
  };
  CHECK(albedoOf(readScene(folder.write("a.xml", body("grey.spd")))).isApprox(grey(0.25f), 1e-5f));
  folder.write("falling.spd", "600 0.25\n500 0.3\n");
  CHECK_THROWS_WITH(readScene(folder.write("b.xml", body("falling.spd"))),
                    Catch::Contains("falling.spd: each line must have a wavelength"));
  CHECK_THROWS_WITH(readScene(folder.write("c.xml", body("none.spd"))), Catch::Contains("none.spd: no such file"));
  CHECK_THAT(faultOf(sphere("<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"400:1 400:2\"/></bsdf>")),
             Catch::Contains("wavelength:value"));
}

TEST_CASE("scenes: black bodies emit by Planck's law") {
  const auto radiance = [](const std::string& attributes) {
    const Scene scene =
        readBody("<emitter type=\"constant\"><blackbody name=\"radiance\" " + attributes + "/></emitter>");
    return scene.environment->radiance.at(0, 0);
  };
  // Planck's law gives 1.27e13 W/(m³ sr) at the peak of 580 nm; the luminance is slightly lower.
  const Rgb warm = radiance("temperature=\"5000K\"");
  CHECK(luminance(warm) == Approx(1.25e4f).epsilon(0.02));
  CHECK(warm.x() > warm.y());
  CHECK(warm.y() > warm.z());
  const Rgb white = radiance("temperature=\"6500\" scale=\"0.001\"");
  CHECK((white / white.y()).isApprox(grey(1.0f), 0.05f));
  CHECK_THAT(faultOf("<emitter type=\"constant\"><blackbody name=\"radiance\" temperature=\"hot\"/></emitter>"),
             Catch::Contains("5000K"));
}

TEST_CASE("scenes: includes and paths and aliases are resolved") {
  const TestFolder folder;
  std::filesystem::create_directory(folder.path() / "parts");
  folder.write("parts/metals.xml",
               "\xef\xbb\xbf<?xml version='1.0'?>\n<scene version='3.0.0'>\n  <default name='r' value='0.3'/>\n"
               "  <bsdf type='diffuse' id='a'><float name='reflectance' value='$r'/></bsdf>\n  <include "
               "filename='empty.xml'></include></scene><!-- end -->");
  folder.write("parts/empty.xml", "<scene version='3.0.0'/>");
  folder.write("parts/light.xml",
               "<scene version='3.0.0'>\n <emitter type='constant'/>\n <shape type='torus'/></scene>");
  const std::string head = "<scene version='3.0.0'><path value='parts'/>\n<default name='file' value='metals'/>\n";
  const std::string tail = "<alias id='a' as='b'/><shape type='disk'><ref id='b'/></shape>\n";
  const auto scene = [&](const std::string& middle) {
    return folder.write("main.xml", head + middle + tail + kSensor + "</scene>");
  };
  CHECK(albedoOf(readScene(scene("<include filename='$file.xml'/>"))).x() == Approx(0.3f));
  ReadOptions options;
  options.definitions["r"] = "0.6";
  CHECK(albedoOf(readScene(scene("<include filename='$file.xml'/>"), options)).x() == Approx(0.6f));

  const auto fault = [&](const std::string& middle) {
    try {
      readScene(scene(middle));
    } catch (const SceneError& error) {
      return std::string(error.what()).substr(folder.path().string().size() + 1);
    }
    return std::string();
  };
  CHECK_THAT(fault("<include filename='metals.xml'/><include filename='light.xml'/>\n"),
             Catch::StartsWith("parts/light.xml:3:2: unknown shape type \"torus\""));
  CHECK_THAT(fault("<include filename='metals.xml'/>  <shape type='torus'/>"),
             Catch::StartsWith("main.xml:3:35: unknown shape type"));
  CHECK_THAT(fault("<include filename='metals.xml'/>\n<include filename='metals.xml'/>"),
             Catch::StartsWith("parts/metals.xml:4:3: the id \"a\" is already used by the <bsdf> at") &&
                 Catch::Contains("metals.xml:4:3"));
  CHECK_THAT(fault("<include filename='none.xml'/>"),
             Catch::StartsWith("main.xml:3:1: ") && Catch::Contains("none.xml"));
  CHECK_THAT(fault("<include filename='main.xml'/>"), Catch::StartsWith("main.xml:3:1: ") && Catch::Contains("itself"));
  folder.write("parts/broken.xml", "<scene>\n <shape></scene>");
  CHECK_THAT(fault("<include filename='broken.xml'/>"),
             Catch::StartsWith("parts/broken.xml:2:") && Catch::Contains("broken XML"));
  CHECK_THAT(fault("<path value='nowhere'/>"), Catch::Contains("nowhere"));
}

TEST_CASE("scenes: comments that contain end tags do not end included files and includes") {
  const TestFolder folder;
  const std::string shape = "<shape type='sphere'/>";
  const auto shapes = [&](const std::string& included, const std::string& include) {
    folder.write("part.xml", included);
    const Scene scene = readScene(folder.write(
        "main.xml", "<?xml version='1.0'?><!-- </scene> --><scene version='3.0.0'>" + include + shape + kSensor +
                        "<!-- </scene> --></scene ><!-- end of </scene> -->\n<?end </scene>?>\n"));
    return scene.shapes.size();
  };
  const std::string start = "<scene version='3.0.0'>", plain = "<include filename='part.xml'/>";
  const std::string part = start + shape + "</scene>";
  for (const std::string end : {"<!-- end of </scene> -->", "<!--</scene>-->\n<!-- a -->", "<?end </scene>?>", "\n"}) {
    CAPTURE(end);
    CHECK(shapes(part + end, plain) == 2);
    CHECK(shapes(end == "\n" ? part : end + part, plain) == 2);
    CHECK(shapes(start + shape + "<!-- </scene> --></scene\n>" + end, plain) == 2);
    CHECK(shapes(start + "</scene>" + end, plain) == 1);
    CHECK(shapes("<scene version='3.0.0'/>" + end, plain) == 1);
  }
  const std::string open = "<include filename='part.xml'>";
  for (const std::string inside : {"", "<!-- </include> -->", "<!--</include>--> ", "<?end </include>?>"}) {
    CAPTURE(inside);
    const std::string include = open + inside + "</include >";
    CHECK(shapes(part, include) == 2);
    CHECK(shapes(part, include + "<!-- </include> -->") == 2);
    CHECK(shapes(part, include + "\n" + include + plain) == 4);
    folder.write("last.xml", part);
    CHECK(shapes(start + "<include filename='last.xml'>" + inside + "</include>\n</scene><!-- </scene> -->", plain) ==
          2);
  }
}

TEST_CASE("scenes: emitters and films and filters and samplers at the top level can be referenced") {
  const Scene scene = readText(
      "<scene version=\"3.0.0\"><emitter type=\"area\" id=\"glow\"><rgb name=\"radiance\" value=\"3\"/></emitter>"
      "<sampler type=\"independent\" id=\"s\"/><rfilter type=\"tent\" id=\"r\"/>"
      "<film type=\"hdrfilm\" id=\"f\"><integer name=\"width\" value=\"17\"/><ref id=\"r\"/></film>"
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><ref id=\"s\"/><ref id=\"f\"/></sensor>"
      "<shape type=\"disk\"><ref id=\"glow\"/></shape><shape type=\"sphere\"/></scene>");
  CHECK(scene.camera.width == 17);
  CHECK(scene.filter.kind == PixelFilter::Kind::tent);
  REQUIRE(scene.shapes[0].emitter);
  CHECK(scene.shapes[0].emitter->radiance->mean().x() == 3.0f);
  CHECK(!scene.shapes[1].emitter);
}

TEST_CASE("scenes: parameters without effect on the picture are noted in one line") {
  const Scene scene = readBody(
      "<emitter type=\"constant\"><float name=\"scale\" value=\"2.5\"/><transform name=\"toWorld\"/></emitter>"
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><float name=\"shutterOpen\" value=\"0\"/>"
      "<float name=\"shutterClose\" value=\"1\"/><float name=\"focusDistance\" value=\"3\"/></sensor>");
  CHECK(scene.environment->radiance.at(0, 0).x() == 2.5f);
  REQUIRE(!scene.notes.empty());
  CHECK(scene.notes.back() ==
        "parameters without effect on the picture: to_world of emitter \"constant\"; focus_distance, shutter_close, "
        "shutter_open of sensor \"perspective\"");
  CHECK_THAT(faultOf("<emitter type=\"constant\"><float name=\"sun_aperture\" value=\"2\"/></emitter>"),
             Catch::Contains("unknown parameter"));
  CHECK_THAT(faultOfText("<scene version=\"3.0.0\"><sensor type=\"perspective\"><film type=\"hdrfilm\">"
                         "<integer name=\"widht\" value=\"2\"/></film></sensor></scene>"),
             Catch::Contains("did you mean width?"));
}

TEST_CASE("scenes: roughness is accepted in all its spellings") {
  const auto rough = [](const std::string& parameters) {
    return readBody(sphere("<bsdf type=\"roughconductor\">" + parameters + "</bsdf>"));
  };
  const std::string alpha = "<float name=\"alpha\" value=\"";
  const auto distribution = [](const std::string& name) {
    return "<string name=\"distribution\" value=\"" + name + "\"/>";
  };
  const Vec3 oblique = Vec3(0.4f, 0.1f, 0.8f).normalized();
  const auto value = [&](const Scene& scene) { return scene.materials[0].bsdf->eval(kUp, oblique, Vec2::Zero()).x(); };
  CHECK(value(rough(distribution("GGX") + alpha + "0.3\"/>")) == value(rough(distribution("ggx") + alpha + "0.3\"/>")));
  const Scene phong = rough(distribution("phong") + alpha + "0.3\"/>");
  CHECK(value(phong) == value(rough(alpha + "0.3\"/>")));
  REQUIRE(phong.warnings.size() == 1);
  CHECK_THAT(phong.warnings[0], Catch::Contains("distribution phong is replaced by beckmann"));
  CHECK(rough(alpha + "0\"/>").notes ==
        std::vector<std::string>{"bsdf \"roughconductor\": alpha 0 is too small; 0.0001 is used"});
  CHECK(rough("<float name=\"alphaU\" value=\"0.3\"/>").notes.size() == 1);
  const auto ward = [&](const std::string& parameters) {
    return value(readBody(sphere("<bsdf type=\"ward\">" + parameters + "</bsdf>")));
  };
  CHECK(ward(alpha + "0.3\"/>") ==
        ward("<float name=\"alphaU\" value=\"0.3\"/><float name=\"alphaV\" value=\"0.3\"/>"));
}

TEST_CASE("scenes: transforms with degenerate up vectors and rounding errors are accepted") {
  const auto centre = [](const std::string& steps) {
    const Scene scene =
        readBody("<shape type=\"sphere\"><transform name=\"to_world\">" + steps + "</transform></shape>");
    return std::get<Sphere>(scene.shapes[0].geometry).centre;
  };
  CHECK(centre("<lookat origin=\"1, 2, 3\" target=\"1, 9, 3\"/>") == Vec3(1, 2, 3));
  CHECK(centre("<lookat origin=\"1, 2, 3\" target=\"1, 2, 9\" up=\"0, 0, 1\"/>") == Vec3(1, 2, 3));
  // Without an up vector, that of Mitsuba: here, x.
  const Scene scene = readBody(
      "<shape type=\"rectangle\"><transform name=\"to_world\"><lookat origin=\"0, 3, 0\" "
      "target=\"0, 0, 0\"/></transform></shape>");
  const auto& corners = std::get<TriangleMesh>(scene.shapes[0].geometry).positions;
  CHECK((corners[1] - corners[0] - Vec3(0, 0, -2)).norm() < 1e-5f);
  CHECK((corners[3] - corners[0] - Vec3(2, 0, 0)).norm() < 1e-5f);
  CHECK(centre("<matrix value=\"1 0 0 4 0 1 0 5 0 0 1 6 0 1e-8 0 0.9999999\"/>") == Vec3(4, 5, 6));
  CHECK_THAT(faultOf("<shape type=\"sphere\"><transform name=\"to_world\"><lookat origin=\"1 2 3\" target=\"1 2 3\"/>"
                     "</transform></shape>"),
             Catch::Contains("target at its origin"));
}

TEST_CASE("scenes: invalid pixels are replaced by black with a note that names the file") {
  const TestFolder folder;
  const auto note = [&](const std::string& body) {
    const Scene scene = readScene(folder.write("a.xml", sceneOf(body)));
    return scene.notes.empty() ? std::string() : scene.notes[0];
  };
  writeGreyExr(folder.path() / "bad.exr", {-1.0f, 2.0f, std::numeric_limits<float>::quiet_NaN(), 4.0f});
  const std::string filename = "<string name=\"filename\" value=\"bad.exr\"/>";
  CHECK_THAT(note("<emitter type=\"envmap\">" + filename + "</emitter>"),
             Catch::Contains("bad.exr: 2 of 4 pixels are negative or not finite and are replaced by black"));
  const std::string bitmap = "<texture type=\"bitmap\" name=\"radiance\">" + filename + "</texture>";
  CHECK_THAT(note("<shape type=\"disk\"><emitter type=\"area\">" + bitmap + "</emitter></shape>"),
             Catch::Contains("bad.exr: 2 of 4 pixels"));
  CHECK_THAT(note(sphere("<bsdf type=\"bumpmap\"><bsdf type=\"diffuse\"/>" + bitmap + "</bsdf>")),
             Catch::Contains("bad.exr: 1 of 4 pixels are not finite"));
  const Scene scene = readScene(folder.write("b.xml", sceneOf("<emitter type=\"envmap\">" + filename + "</emitter>")));
  CHECK(scene.environment->radiance.at(0, 0).x() == 0.0f);
  CHECK(scene.environment->radiance.at(1, 0).x() == 2.0f);
}

TEST_CASE("scenes: messages about misspelt names suggest the nearest name") {
  CHECK_THAT(faultOf("<bsdf type=\"difuse\"/>"), Catch::Contains("did you mean diffuse? known are blendbsdf"));
  CHECK_THAT(faultOf("<shape type=\"Sphere\"/>"), Catch::Contains("did you mean sphere?"));
  CHECK_THAT(faultOf("<emitter type=\"envmapp\"/>"), Catch::Contains("did you mean envmap?"));
  CHECK_THAT(faultOf("<texture type=\"bitmpa\"/>"), Catch::Contains("did you mean bitmap?"));
  CHECK_THAT(faultOf("<bdsf/>"), Catch::Contains("did you mean bsdf?"));
  CHECK_THAT(faultOf("<bsdf type=\"diffuse\"><float name=\"reflectanc\" value=\"1\"/></bsdf>"),
             Catch::Contains("did you mean reflectance?"));
  CHECK_THAT(faultOf("<bsdf type=\"diffuse\"><flaot name=\"reflectance\" value=\"1\"/></bsdf>"),
             Catch::Contains("did you mean float?"));
  CHECK_THAT(faultOf("<bsdf type=\"roughconductor\"><float name=\"alfa_u\" value=\"1\"/></bsdf>"),
             Catch::Contains("did you mean alpha_u? known are alpha, alpha_u, alpha_v, distribution, "
                             "ensure_energy_conservation, eta"));
  CHECK_THAT(faultOf("<bsdf type=\"velvet\"/>"), !Catch::Contains("did you mean"));
}

TEST_CASE("scenes: elements nested too deeply are rejected") {
  std::string body;
  for (int i = 0; i < 100000; ++i) body += "<bsdf type=\"twosided\">";
  for (int i = 0; i < 100000; ++i) body += "</bsdf>";
  CHECK_THAT(faultOf(body), Catch::StartsWith("test.xml:2:") && Catch::Contains("nested"));
}

}  // namespace lobe
