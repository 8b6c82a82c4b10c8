// Materials in scene files of both dialects: order of nested models, textures by name, encodings.

#include <catch2/catch.hpp>

#include "runtime/core/sampling.h"
#include "tests/support/measured_files.h"
#include "tests/support/scenes_test_tools.h"

namespace lobe {
namespace {

const Vec3 kUp = Vec3::UnitZ();

BsdfPtr bsdfOf(const std::string& element) {
  const Scene scene = readBody("<shape type=\"sphere\">" + element + "</shape>");
  return scene.materials.at(0).bsdf;
}

std::string number(const std::string& name, const std::string& value) {
  return "<float name=\"" + name + "\" value=\"" + value + "\"/>";
}

std::string diffuse(const std::string& reflectance) {
  return "<bsdf type=\"diffuse\">" + number("reflectance", reflectance) + "</bsdf>";
}

float albedoAt(const BsdfPtr& bsdf, const Vec2& uv = Vec2(0.25f, 0.25f)) {
  return bsdf->albedo(kUp, uv).x();
}

/// A 1×1 image of the grey as an uncompressed 24-bit BMP.
std::string greyBmp(char value) {
  std::string bytes("BM\x3a\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x01\0\0\0\x01\0\0\0\x01\0\x18\0\0\0\0\0\x04\0\0\0", 38);
  bytes += std::string(16, '\0');
  return bytes + std::string(3, value) + '\0';
}

}  // namespace

TEST_CASE("scenes: null and difftrans are read") {
  CHECK(bsdfOf("<bsdf type=\"null\"/>")->deltaProbability(kUp, Vec2::Zero()) == 1.0f);
  CHECK(albedoAt(bsdfOf("<bsdf type=\"difftrans\"><spectrum name=\"transmittance\" value=\"0.3\"/></bsdf>")) ==
        Approx(0.3f));
  CHECK(faultOf("<bsdf type=\"null\"><float name=\"opacity\" value=\"1\"/></bsdf>").find("\"opacity\"") !=
        std::string::npos);
}

TEST_CASE("scenes: blends keep the order of nested and referenced bsdfs") {
  const std::string nested = diffuse("0.2") + diffuse("0.6");
  for (const std::string& order : {number("weight", "0.25") + nested, nested + number("weight", "0.25")})
    CHECK(albedoAt(bsdfOf("<bsdf type=\"blendbsdf\">" + order + "</bsdf>")) == Approx(0.3f));
  const Scene scene = readBody(
      "<shape type=\"sphere\"><bsdf type=\"blendbsdf\"><texture name=\"weight\" type=\"checkerboard\">"
      "<rgb name=\"color0\" value=\"1\"/><rgb name=\"color1\" value=\"0\"/></texture>"
      "<ref id=\"A\"/><ref name=\"bsdf_1\" id=\"B\"/></bsdf></shape>"
      "<bsdf type=\"diffuse\" id=\"B\"><float name=\"reflectance\" value=\"0.8\"/></bsdf>"
      "<bsdf type=\"diffuse\" id=\"A\"><float name=\"reflectance\" value=\"0.1\"/></bsdf>");
  // A checkerboard of numbers has color0 where one coordinate is in the lower half and the other in the upper half.
  CHECK(albedoAt(scene.materials.at(0).bsdf, Vec2(0.25f, 0.25f)) == Approx(0.1f));
  CHECK(albedoAt(scene.materials.at(0).bsdf, Vec2(0.75f, 0.25f)) == Approx(0.8f));
  CHECK(faultOf("<bsdf type=\"blendbsdf\">" + diffuse("0.2") + "</bsdf>").find("two nested bsdfs") !=
        std::string::npos);
}

TEST_CASE("scenes: mixtures weight their nested bsdfs") {
  const BsdfPtr mixture = bsdfOf("<bsdf type=\"mixturebsdf\"><string name=\"weights\" value=\"0.5, 0.25\"/>" +
                                 diffuse("0.2") + diffuse("0.8") + "</bsdf>");
  CHECK(albedoAt(mixture) == Approx(0.3f));
  const std::string fault = faultOf("<bsdf type=\"mixturebsdf\">\n<string name=\"weights\" value=\"0.5, b\"/>" +
                                    diffuse("0.2") + diffuse("0.8") + "</bsdf>");
  INFO(fault);
  CHECK(fault.starts_with("test.xml:3:1: "));
  CHECK(fault.find("\"b\"") != std::string::npos);
}

TEST_CASE("scenes: normal maps are linear for any stated encoding and other textures stay colours") {
  const TestFolder folder;
  folder.write("grey.bmp", greyBmp('\xcc'));  // 0.8 as a linear value, 0.6 as an sRGB colour
  const std::string file = "<string name=\"filename\" value=\"grey.bmp\"/>";
  const auto leaning = [&](const std::string& texture, const std::string& rest = "") {
    const Scene scene =
        readScene(folder.write("test.xml", sceneOf("<shape type=\"sphere\"><bsdf type=\"normalmap\">" + texture +
                                                   diffuse("0.5") + "</bsdf></shape>" + rest)));
    return scene.materials.at(0).bsdf->perturbedNormal(kUp, Vec2(0.5f, 0.5f), Vec3::UnitX(), Vec3::UnitY());
  };
  const std::string scale = "<rgb name=\"scale\" value=\"0.625 0.625 1\"/>";  // 0.5, 0.5, 0.8: straight up
  const auto scaled = [&](const std::string& bitmap) {
    return "<texture name=\"normalmap\" type=\"scale\">" + scale + bitmap + "</texture>";
  };
  for (const std::string says :
       {"", "<float name=\"gamma\" value=\"2.2\"/>", "<boolean name=\"raw\" value=\"true\"/>"}) {
    const Vec3 n = leaning(scaled("<texture type=\"bitmap\">" + file + says + "</texture>"));
    INFO(n.transpose());
    CHECK((n - Vec3::UnitZ()).norm() < 1e-2f);
  }
  const Vec3 n =
      leaning(scaled("<ref id=\"T\"/>"),
              "<shape type=\"disk\"><bsdf type=\"diffuse\"><ref name=\"reflectance\" id=\"T\"/></bsdf></shape>"
              "<texture type=\"bitmap\" id=\"T\">" +
                  file + "</texture>");
  CHECK((n - Vec3::UnitZ()).norm() < 1e-2f);
  const Scene both = readScene(folder.path() / "test.xml");
  CHECK(albedoAt(both.materials.at(1).bsdf) == Approx(0.604f).epsilon(1e-2));
}

TEST_CASE("scenes: a mask inside twosided is rejected") {
  const std::string masked = "<bsdf type=\"mask\">" + diffuse("0.5") + "</bsdf>";
  CHECK(faultOf("<bsdf type=\"twosided\">" + masked + "</bsdf>").find("mask > twosided") != std::string::npos);
  CHECK(faultOf("<bsdf type=\"mask\"><bsdf type=\"twosided\">" + diffuse("0.5") + "</bsdf></bsdf>") == "");
}

TEST_CASE("scenes: phong and ward and roughdiffuse in the spelling of Mitsuba 0.6") {
  const std::string checkerboard = "<texture type=\"checkerboard\" name=";
  const BsdfPtr phong = bsdfOf("<bsdf type=\"phong\"><float name=\"exponent\" value=\"50\"/>" + checkerboard +
                               "\"diffuseReflectance\"/><spectrum name=\"specularReflectance\" value=\"0.3\"/></bsdf>");
  CHECK(phong->mixture(kUp, Vec2(0.25f, 0.25f)).constant == Approx(0.4f));
  CHECK(phong->mixture(kUp, Vec2(0.75f, 0.25f)).constant == Approx(0.2f));
  CHECK(phong->mixture(kUp, Vec2::Zero()).glossy[0].tint == Approx(0.3f));
  CHECK(phong->lobes()[0]->summary() == "phong, exponent 50");
  const BsdfPtr ward = bsdfOf("<bsdf type=\"ward\"><string name=\"variant\" value=\"ward-duer\"/>" +
                              number("alphaU", "0.1") + number("alphaV", "0.3") + "</bsdf>");
  CHECK(ward->lobes()[0]->summary() == "ward-duer α 0.1×0.3");
  const BsdfPtr rough =
      bsdfOf("<bsdf type=\"roughdiffuse\">" + checkerboard + "\"alpha\"/>" + number("reflectance", "0.6") +
             "<boolean name=\"useFastApprox\" value=\"true\"/></bsdf>");
  // A rougher surface is darker; in files for Mitsuba 3, the rougher squares are those where the coordinates differ.
  CHECK(albedoAt(rough, Vec2(0.25f, 0.25f)) > albedoAt(rough, Vec2(0.75f, 0.25f)));
  const std::string fault = faultOf("<bsdf type=\"phong\">\n" + number("alpha", "0.1") + "</bsdf>");
  INFO(fault);
  CHECK(fault.starts_with("test.xml:3:1: "));
  CHECK(fault.find("diffuse_reflectance, ensure_energy_conservation, exponent, specular_reflectance") !=
        std::string::npos);
}

TEST_CASE("scenes: measured materials are read relative to the scene and only if they are used") {
  const TestFolder folder;
  const auto fields = measuredFields([](const auto&, const auto&) { return grey(0.1f); }, {0.0f}, 4);
  std::filesystem::create_directory(folder.path() / "data");
  folder.write("data/paint_rgb.bsdf", tensorFile(fields));
  const std::string unused =
      "<bsdf type=\"twosided\" id=\"Unused\"><bsdf type=\"merl\"><string name=\"filename\" "
      "value=\"none\"/></bsdf></bsdf>";
  const std::string paint =
      "<bsdf type=\"measured\" id=\"Paint\"><string name=\"filename\" value=\"data/paint_rgb.bsdf\"/></bsdf>";
  const std::string shape = "<shape type=\"sphere\"><ref id=\"Paint\"/></shape>";
  const Scene scene = readScene(folder.write("test.xml", sceneOf(unused + paint + shape + shape)));
  REQUIRE(scene.materials.size() == 1);
  REQUIRE(scene.materials[0].bsdf->lobes().size() == 1);
  CHECK(scene.materials[0].bsdf->lobes()[0]->summary() == "paint_rgb");
}

TEST_CASE("scenes: equal measured materials share the data of their file") {
  const TestFolder folder;
  const auto fields = measuredFields([](const auto&, const auto&) { return grey(0.1f); }, {0.0f}, 4);
  for (const std::string name : {"a_rgb.bsdf", "b_rgb.bsdf"}) folder.write(name, tensorFile(fields));
  const auto sphere = [](const std::string& file) {
    return "<shape type=\"sphere\"><bsdf type=\"measured\"><string name=\"filename\" value=\"" + file +
           "\"/></bsdf></shape>";
  };
  const std::string body = sphere("a_rgb.bsdf") + sphere("a_rgb.bsdf") + sphere("b_rgb.bsdf");
  const Scene scene = readScene(folder.write("test.xml", sceneOf(body)));
  REQUIRE(scene.materials.size() == 3);
  CHECK(scene.materials[0].bsdf == scene.materials[1].bsdf);
  CHECK(scene.materials[0].bsdf != scene.materials[2].bsdf);
}

TEST_CASE("scenes: faults of measured materials are reported with their location") {
  const auto inSphere = [](const std::string& type, const std::string& parameters) {
    return "<shape type=\"sphere\">\n<bsdf type=\"" + type + "\">\n " + parameters + "</bsdf></shape>";
  };
  const std::string missing = inSphere("measured", "<string name=\"filename\" value=\"none_rgb.bsdf\"/>");
  CHECK_THAT(faultOf(missing), Catch::StartsWith("test.xml:4:2: ") && Catch::Contains("none_rgb.bsdf does not exist"));
  CHECK(readBody(missing, lenient()).warnings.size() == 1);
  // The scene file itself is not a measurement.
  for (const std::string type : {"measured", "merl"})
    CHECK_THAT(faultOf(inSphere(type, "<string name=\"filename\" value=\"test.xml\"/>")),
               Catch::StartsWith("test.xml:4:2: ") && Catch::Contains("not a"));
  CHECK_THAT(faultOf(inSphere("merl", "")), Catch::StartsWith("test.xml:3:1: ") && Catch::Contains("\"filename\""));
  CHECK_THAT(faultOf(inSphere("measured", "<float name=\"filename\" value=\"1\"/>")), Catch::Contains("text"));
}

TEST_CASE("scenes: principled in the spelling of Mitsuba 3") {
  const BsdfPtr bsdf =
      bsdfOf("<bsdf type=\"principled\"><rgb name=\"base_color\" value=\"1.0,1.0,1.0\"/>" + number("metallic", "0.7") +
             number("specular", "0.6") + number("roughness", "0.2") + number("spec_tint", "0.4") +
             number("anisotropic", "0.5") + number("sheen", "0.3") + number("sheen_tint", "0.2") +
             number("clearcoat", "0.6") + number("clearcoat_gloss", "0.3") + number("spec_trans", "0.4") +
             number("flatness", "0.1") + number("main_specular_sampling_rate", "1") +
             number("clearcoat_sampling_rate", "1") + number("diffuse_reflectance_sampling_rate", "1") + "</bsdf>");
  CHECK(bsdf->transmits());
  CHECK(bsdf->lobes().size() == 2);
  const BsdfPtr textured = bsdfOf(
      "<bsdf type=\"twosided\"><bsdf type=\"principled\"><texture name=\"base_color\" type=\"checkerboard\"/>"
      "<texture name=\"metallic\" type=\"checkerboard\"/></bsdf></bsdf>");
  // 0.4 · (1 − 0.2) against 0.2 · (1 − 0.4): the squares of numbers are exchanged.
  CHECK(textured->mixture(kUp, Vec2(0.25f, 0.25f)).constant ==
        Approx(8.0f / 3 * textured->mixture(kUp, Vec2(0.75f, 0.25f)).constant));
  const std::string fault =
      faultOf("<bsdf type=\"principled\">\n" + number("eta", "1.5") + "\n" + number("specular", "0.5") + "</bsdf>");
  INFO(fault);
  CHECK(fault.starts_with("test.xml:4:1: "));
  CHECK(fault.find("either eta or specular") != std::string::npos);
  CHECK(faultOf("<bsdf type=\"principled\">" + number("clearcoat_glass", "1") + "</bsdf>").find("clearcoat_gloss") !=
        std::string::npos);
}

TEST_CASE("scenes: mapped normals are flipped and shadowed by default from version 3 on") {
  const auto shadows = [](const std::string& version, const std::string& option) {
    const Scene scene =
        readText("<scene version=\"" + version + "\"><shape type=\"sphere\"><bsdf type=\"bumpmap\">" + option +
                 "<texture type=\"checkerboard\"/>" + diffuse("0.5") + "</bsdf></shape>" + kSensor + "</scene>");
    return scene.materials.at(0).bsdf->shadowsTerminator();
  };
  CHECK(shadows("3.0.0", ""));
  CHECK(shadows("3.7.1", ""));
  CHECK_FALSE(shadows("2.1.0", ""));
  CHECK_FALSE(shadows("0.6.0", ""));
  CHECK_FALSE(shadows("3.0.0", "<boolean name=\"use_shadowing_function\" value=\"false\"/>"));
  CHECK(shadows("2.1.0", "<boolean name=\"use_shadowing_function\" value=\"true\"/>"));
  const Scene leaning = readBody(
      "<shape type=\"sphere\"><bsdf type=\"normalmap\"><boolean name=\"flip_invalid_normals\" value=\"false\"/>"
      "<texture type=\"checkerboard\"><rgb name=\"color0\" value=\"0.8 0.5 0.9\"/></texture>" +
      diffuse("0.5") + "</bsdf></shape>");
  const auto normal = [](const Scene& scene) {
    return scene.materials.at(0).bsdf->perturbedNormal(Vec3(-0.9f, 0.0f, 0.2f).normalized(), Vec2(0.25f, 0.25f),
                                                       Vec3::UnitX(), Vec3::UnitY());
  };
  CHECK(normal(leaning).x() == Approx(0.6f).epsilon(1e-4));
  CHECK(leaning.notes.empty());
}

TEST_CASE(
    "scenes: reflectances above 1 are scaled below version 2 and kept from version 2 on with a warning at their line") {
  const auto read = [](const std::string& version, const std::string& option = "") {
    return readText("<scene version=\"" + version + "\">\n<shape type=\"sphere\"><bsdf type=\"plastic\">" + option +
                    "\n <rgb name=\"diffuseReflectance\" value=\"255 255 25.5\"/></bsdf></shape>" + kSensor +
                    "</scene>");
  };
  const auto diffuseFraction = [](const Scene& scene) {
    return scene.materials.at(0).bsdf->mixture(kUp, Vec2::Zero()).constant;
  };
  const Scene old = read("0.5.0");
  REQUIRE(old.warnings.size() == 1);
  CHECK_THAT(old.warnings[0], Catch::Contains("test.xml:3:2: bsdf \"plastic\": diffuse_reflectance is up to 255") &&
                                  Catch::Contains("scaled"));
  const Scene today = read("3.0.0");
  REQUIRE(today.warnings.size() == 1);
  CHECK_THAT(today.warnings[0], Catch::Contains("test.xml:3:2: ") && Catch::Contains("kept"));
  CHECK(diffuseFraction(old) == Approx(diffuseFraction(today) * 0.99f / 255.0f));
  const Scene insisting = read("0.5.0", "<boolean name=\"ensureEnergyConservation\" value=\"false\"/>");
  CHECK(insisting.warnings.empty());
  CHECK(diffuseFraction(insisting) == Approx(diffuseFraction(today)));
  CHECK(read("").materials.at(0).bsdf->albedo(kUp, Vec2::Zero()).maxCoeff() <= 1.0f);
}

TEST_CASE("scenes: textures above 1 are scaled as a whole") {
  const Scene scene = readText(
      "<scene version=\"0.6.0\"><shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"scale\" "
      "name=\"reflectance\"><float name=\"scale\" value=\"10\"/><texture "
      "type=\"checkerboard\"/></texture></bsdf></shape>" +
      std::string(kSensor) + "</scene>");
  CHECK(scene.warnings.size() == 1);
  CHECK(albedoAt(scene.materials.at(0).bsdf, Vec2(0.25f, 0.25f)) == Approx(0.99f));
  CHECK(albedoAt(scene.materials.at(0).bsdf, Vec2(0.75f, 0.25f)) == Approx(0.495f));
}

TEST_CASE("scenes: mixture weights whose sum exceeds 1") {
  const auto read = [](const std::string& option) {
    return readText("<scene version=\"0.6.0\"><shape type=\"sphere\"><bsdf type=\"mixturebsdf\">" + option +
                    "\n<string name=\"weights\" value=\"1, 1\"/>" + diffuse("0.08") + diffuse("0.9") +
                    "</bsdf></shape>" + kSensor + "</scene>");
  };
  const Scene given = read("<boolean name=\"ensureEnergyConservation\" value=\"false\"/>");
  CHECK(given.warnings.empty());
  CHECK(albedoAt(given.materials.at(0).bsdf) == Approx(0.98f));
  const Scene scaled = read("");
  REQUIRE(scaled.warnings.size() == 1);
  CHECK_THAT(scaled.warnings[0], Catch::Contains("test.xml:2:1: "));
  CHECK(albedoAt(scaled.materials.at(0).bsdf) == Approx(0.49f));
}

TEST_CASE("scenes: coatings and thin surfaces in the spelling of Mitsuba") {
  const std::string coat =
      "<float name=\"intIOR\" value=\"1.5\"/><float name=\"extIOR\" value=\"1\"/><float name=\"thickness\" "
      "value=\"2\"/><spectrum name=\"sigmaA\" value=\"0.1 0.2 0.5\"/>"
      "<spectrum name=\"specularReflectance\" value=\"0.5\"/>";
  const BsdfPtr smooth = bsdfOf("<bsdf type=\"coating\">" + coat + diffuse("1") + "</bsdf>");
  // Perpendicularly through a thickness of 2 and back.
  const Rgb expected = (-4.0f * Rgb(0.1f, 0.2f, 0.5f)).exp() * (0.96f * 0.96f / (2.25f * kPi));
  CHECK(smooth->eval(kUp, kUp, Vec2::Zero()).isApprox(expected, 1e-4f));
  CHECK(smooth->sampleDelta(kUp, Vec2::Zero(), 0.5f)->weight.x() == Approx(0.02f));
  const BsdfPtr rough = bsdfOf("<bsdf type=\"roughcoating\"><string name=\"distribution\" value=\"ggx\"/>" +
                               number("alpha", "0.2") + coat + diffuse("0") + "</bsdf>");
  CHECK(rough->lobes()[0]->summary() == "ggx α 0.2, dielectric 1.5");
  CHECK(rough->mixture(kUp, Vec2::Zero()).glossy[0].tint == Approx(0.5f));
  const BsdfPtr thin = bsdfOf("<bsdf type=\"principledthin\"><rgb name=\"base_color\" value=\"0.7 0.1 0.1\"/>" +
                              number("roughness", "0.15") + number("spec_tint", "0.1") + number("anisotropic", "0.5") +
                              number("spec_trans", "0.8") + number("diff_trans", "0.3") + number("eta", "1.33") +
                              number("specular_transmittance_sampling_rate", "1") + "</bsdf>");
  CHECK(thin->transmits());
  CHECK_THAT(faultOf("<bsdf type=\"hk\"/>"), Catch::Contains("unknown bsdf type \"hk\""));
}

}  // namespace lobe
