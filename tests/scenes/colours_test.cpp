// Values of colours, spectra, textures and lights in scene files of both dialects.

#include <cstdint>
#include <numbers>
#include <string>

#include <sys/resource.h>

#include <catch2/catch.hpp>

#include "tests/support/scenes_test_tools.h"
#include "tests/support/small_images.h"

namespace lobe {
namespace {

const Vec3 kUp = Vec3::UnitZ();

std::string ofVersion(const std::string& version, const std::string& body) {
  return "<scene version=\"" + version + "\">\n" + body + "\n" + kSensor + "\n</scene>\n";
}

/// The emission of an emitter with this radiance.
Rgb radianceOf(const std::string& element, const std::string& version = "3.0.0") {
  return readText(ofVersion(version, "<emitter type=\"constant\">" + element + "</emitter>"))
      .environment->radiance.at(0, 0);
}

Rgb reflectanceOf(const std::string& element, const std::string& version = "3.0.0",
                  const Vec2& uv = Vec2(0.25f, 0.25f)) {
  return readText(ofVersion(version, "<shape type=\"sphere\"><bsdf type=\"diffuse\">" + element + "</bsdf></shape>"))
      .materials.at(0)
      .bsdf->albedo(kUp, uv);
}

void checkNear(const Rgb& value, const Rgb& expected, float tolerance = 1e-3f) {
  INFO(value.transpose() << " is not " << expected.transpose());
  CHECK((value - expected).abs().maxCoeff() <= tolerance * expected.maxCoeff());
}

/// A row of two pixels.
std::string blackAndWhite() {
  return rowPng(std::string("\0\0\0\xff\xff\xff", 6), 3);
}

/// A grey PNG of this width and height.
std::string squarePng(std::uint32_t size) {
  std::string rows;
  for (std::uint32_t y = 0; y < size; ++y) rows += '\0' + std::string(size, '\x80');
  return pngFile({size, size, 8, PngColours::grey}, deflated(rows));
}

std::string sphereWithBitmap(const std::string& parameters) {
  return "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\">"
         "<string name=\"filename\" value=\"a.png\"/>" +
         parameters + "</texture></bsdf></shape>\n";
}

/// The most memory that this process has had, in bytes.
long peakMemory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024 * usage.ru_maxrss;
}

const Rgb kEqualEnergy(1.205f, 0.948f, 0.909f);

std::string named(const std::string& name, const std::string& element, const std::string& rest) {
  return "<" + element + " name=\"" + name + "\" " + rest;
}

}  // namespace

TEST_CASE("scenes: reflectance spectra are weighted by daylight as in Mitsuba and emission spectra are not") {
  const std::string even = "value=\"300:1, 900:1\"/>", ramp = "value=\"360:0, 830:1\"/>";
  const auto emitted = [](const std::string& value, const std::string& version) {
    return radianceOf(named("radiance", "spectrum", value), version);
  };
  const auto reflected = [](const std::string& value, const std::string& version) {
    return reflectanceOf(named("reflectance", "spectrum", value), version);
  };
  // Sums over the tables of observer and daylight, every nanometre.
  const Rgb rampSeen(0.7055f, 0.3707f, 0.1498f), rampReflected(0.6009f, 0.3894f, 0.1720f);
  for (const std::string version : {"0.6.0", "2.0.0", "3.5.0"}) {
    CAPTURE(version);
    checkNear(emitted(even, version), kEqualEnergy);
    checkNear(emitted(ramp, version), rampSeen);
    checkNear(emitted("value=\"1\"/>", version), grey(1.0f), 0);
    const bool daylight = version != "0.6.0";
    checkNear(reflected("value=\"300:0.5, 900:0.5\"/>", version), daylight ? grey(0.5f) : Rgb(0.5f * kEqualEnergy));
    checkNear(reflected(ramp, version), daylight ? rampReflected : rampSeen);
  }
}

TEST_CASE("scenes: a black body equals its tabulated spectrum") {
  // Planck's law at 4500 K in W/(m² sr nm), every 10 nm.
  std::string wavelengths, values, pairs;
  for (int nm = 360; nm <= 830; nm += 10) {
    const std::string value =
        std::to_string(1.191042972e20 / std::pow(nm, 5) / std::expm1(1.438776877e7 / (nm * 4500.0)));
    const std::string comma = nm < 830 ? ", " : "";
    wavelengths += std::to_string(nm) + comma;
    values += value + comma;
    pairs += std::to_string(nm) + ":" + value + comma;
  }
  for (const std::string version : {"0.6.0", "3.0.0"}) {
    const auto radiance = [&](const std::string& element, const std::string& rest) {
      return radianceOf(named("radiance", element, rest), version);
    };
    const Rgb body = radiance("blackbody", "temperature=\"4500K\"/>");
    CHECK(body.x() > 1.5f * body.z());
    checkNear(radiance("spectrum", "value=\"" + pairs + "\"/>"), body);
    checkNear(radiance("spectrum", "type=\"blackbody\"><float name=\"temperature\" value=\"4500\"/></spectrum>"), body,
              1e-6f);
    checkNear(radiance("spectrum", "type=\"irregular\"><string name=\"wavelengths\" value=\"" + wavelengths +
                                       "\"/><string name=\"values\" value=\"" + values + "\"/></spectrum>"),
              body);
    checkNear(radiance("texture",
                       "type=\"regular\"><float name=\"lambda_min\" value=\"360\"/>"
                       "<float name=\"wavelength_max\" value=\"830\"/><string name=\"values\" value=\"" +
                           values + "\"/></texture>"),
              body);
  }
}

TEST_CASE("scenes: the type of a spectrum or texture matters and not the name of its element") {
  const auto radiance = [](const std::string& element, const std::string& rest) {
    return radianceOf(named("radiance", element, rest + "</" + element + ">"));
  };
  for (const std::string element : {"spectrum", "rgb", "texture"}) {
    CAPTURE(element);
    checkNear(radiance(element, "type=\"d65\"><float name=\"scale\" value=\"2\"/>"), grey(2.0f), 0);
    checkNear(
        radiance(element, "type=\"d65\"><rgb name=\"color\" value=\"1 2 3\"/><float name=\"scale\" value=\"2\"/>"),
        Rgb(2, 4, 6), 0);
    checkNear(radiance(element, "type=\"uniform\"><float name=\"value\" value=\"3\"/>"), grey(3.0f), 0);
    checkNear(radiance(element, "type=\"rawconstant\"><vector name=\"value\" value=\"3, 2, 1\"/>"), Rgb(3, 2, 1), 0);
    checkNear(radiance(element, "type=\"srgb\"><rgb name=\"color\" value=\"0.1 0.2 0.3\"/>"), Rgb(0.1f, 0.2f, 0.3f), 0);
    checkNear(radiance(element,
                       "type=\"d65\"><spectrum name=\"value\" type=\"uniform\">"
                       "<float name=\"value\" value=\"3\"/></spectrum>"),
              grey(3.0f), 0);
  }
  // As reflectances, in other textures, by reference, and for lights that accept colours only.
  checkNear(reflectanceOf("<texture name=\"reflectance\" type=\"irregular\"><string name=\"wavelengths\" "
                          "value=\"300, 900\"/><string name=\"values\" value=\"0.4, 0.4\"/></texture>"),
            grey(0.4f));
  checkNear(reflectanceOf("<spectrum name=\"reflectance\" type=\"checkerboard\"><spectrum name=\"color0\" "
                          "type=\"uniform\"><float name=\"value\" value=\"0.7\"/></spectrum></spectrum>"),
            grey(0.7f), 1e-6f);
  const Scene scene = readBody(
      "<spectrum id=\"day\" type=\"d65\"><float name=\"scale\" value=\"5\"/></spectrum>"
      "<emitter type=\"point\"><ref name=\"intensity\" id=\"day\"/></emitter>"
      "<emitter type=\"directional\"><spectrum name=\"irradiance\" type=\"d65\"/></emitter>");
  checkNear(std::get<PointLight>(scene.lights.at(0)).intensity, grey(5.0f), 0);
  checkNear(std::get<DirectionalLight>(scene.lights.at(1)).irradiance, grey(1.0f), 0);
}

TEST_CASE("scenes: bitmaps in colour elements and nested in d65") {
  const TestFolder folder;
  folder.write("a.png", blackAndWhite());
  const auto radiance = [&](const std::string& element) {
    const std::string body = "<shape type=\"sphere\"><emitter type=\"area\">" + element + "</emitter></shape>";
    return readScene(folder.write("a.xml", ofVersion("3.0.0", body))).shapes.at(0).emitter->radiance;
  };
  const std::string file = "<string name=\"filename\" value=\"a.png\"/>";
  const TexturePtr plain = radiance("<rgb name=\"radiance\" type=\"bitmap\">" + file + "</rgb>");
  CHECK(plain->eval(Vec2(0.75f, 0.5f)).x() == 1.0f);
  CHECK(plain->eval(Vec2(0.25f, 0.5f)).x() == 0.0f);
  const TexturePtr scaled = radiance(
      "<spectrum name=\"radiance\" type=\"d65\"><float name=\"scale\" value=\"4\"/>"
      "<texture name=\"value\" type=\"bitmap\">" +
      file + "</texture></spectrum>");
  CHECK(scaled->eval(Vec2(0.75f, 0.5f)).x() == 4.0f);
}

TEST_CASE("scenes: faults of spectra with a type are reported with their location") {
  const auto fault = [](const std::string& rest) {
    return faultOf("<emitter type=\"constant\">\n<spectrum name=\"radiance\" " + rest + "</spectrum></emitter>");
  };
  CHECK_THAT(fault("type=\"blackbody\">"), Catch::StartsWith("test.xml:3:1: ") && Catch::Contains("temperature"));
  CHECK_THAT(fault("type=\"uniform\">"), Catch::Contains("value"));
  CHECK_THAT(fault("type=\"d65\">\n<float name=\"scael\" value=\"2\"/>"),
             Catch::StartsWith("test.xml:4:1: ") && Catch::Contains("did you mean scale"));
  CHECK_THAT(fault("type=\"irregular\">\n<string name=\"wavelengths\" value=\"400, 500\"/>"
                   "<string name=\"values\" value=\"1\"/>"),
             Catch::Contains("a value for each"));
  CHECK_THAT(fault("type=\"d56\">"), Catch::Contains("unknown texture type \"d56\"; did you mean d65?"));
  CHECK_THAT(fault("type=\"checkerboard\">"), Catch::StartsWith("test.xml:3:1: ") && Catch::Contains("type colour"));
}

TEST_CASE("scenes: a checkerboard of numbers has its squares exchanged in Mitsuba 2 and 3") {
  const auto board = [](const std::string& name) {
    return "<texture name=\"" + name +
           "\" type=\"checkerboard\"><float name=\"color0\" value=\"0.9\"/>"
           "<float name=\"color1\" value=\"0.1\"/></texture>";
  };
  const std::string black = "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0\"/></bsdf>";
  const std::string white = "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"1\"/></bsdf>";
  const Vec2 same(0.25f, 0.25f), mixed(0.25f, 0.75f);
  const auto albedo = [](const std::string& version, const std::string& bsdf, const Vec2& uv) {
    return readText(ofVersion(version, "<shape type=\"sphere\">" + bsdf + "</shape>"))
        .materials.at(0)
        .bsdf->albedo(kUp, uv)
        .x();
  };
  const auto scaled =
      "<texture name=\"weight\" type=\"scale\"><float name=\"scale\" value=\"0.5\"/>" + board("") + "</texture>";
  const std::string blend = "<bsdf type=\"blendbsdf\">" + black + white;
  const std::string mask = "<bsdf type=\"mask\">" + black + board("opacity") + "</bsdf>";
  for (const std::string version : {"0.6.0", "2.0.0", "3.0.0"}) {
    CAPTURE(version);
    const bool today = version != "0.6.0";
    const float first = today ? 0.1f : 0.9f;  // of numbers; colours have 0.9
    CHECK(reflectanceOf(board("reflectance"), version, same).x() == Approx(0.9f));
    CHECK(reflectanceOf(board("reflectance"), version, mixed).x() == Approx(0.1f));
    CHECK(albedo(version, blend + board("weight") + "</bsdf>", same) == Approx(first));
    CHECK(albedo(version, blend + board("weight") + "</bsdf>", mixed) == Approx(1 - first));
    CHECK(albedo(version, blend + scaled + "</bsdf>", same) == Approx(0.5f * first));
    CHECK(albedo(version, mask, same) == Approx(1 - first));
  }
}

TEST_CASE("scenes: textured roughness has the same squares as in Mitsuba") {
  const auto peak = [](const std::string& version, const std::string& type, const std::string& alpha, const Vec2& uv) {
    const Scene scene =
        readText(ofVersion(version, "<shape type=\"sphere\"><bsdf type=\"" + type + "\">" + alpha + "</bsdf></shape>"));
    return scene.materials.at(0).bsdf->eval(kUp, kUp, uv).x();
  };
  const auto board = [](const std::string& name) {
    return "<texture name=\"" + name +
           "\" type=\"checkerboard\"><float name=\"color0\" value=\"0.5\"/>"
           "<float name=\"color1\" value=\"0.2\"/></texture>";
  };
  const auto number = [](const std::string& name, const std::string& value) {
    return "<float name=\"" + name + "\" value=\"" + value + "\"/>";
  };
  for (const auto& [type, name] : {std::pair<std::string, std::string>{"roughconductor", "alpha"},
                                   {"principled", "roughness"},
                                   {"roughplastic", "alpha"}}) {
    CAPTURE(type);
    const Vec2 same(0.75f, 0.75f);
    // Textured roughplastic selects tables by its mean roughness, so the tolerance only distinguishes the squares.
    CHECK(peak("3.0.0", type, board(name), same) ==
          Approx(peak("3.0.0", type, number(name, "0.2"), same)).epsilon(0.05));
    CHECK(peak("0.6.0", type, board(name), same) ==
          Approx(peak("0.6.0", type, number(name, "0.5"), same)).epsilon(0.05));
  }
}

TEST_CASE("scenes: bitmaps are read by channel") {
  const TestFolder folder;
  folder.write("a.png", rowPng("\xff\x99\x33\x66", 4));
  const auto value = [&](const std::string& channel, const std::string& file = "a.png") {
    const std::string body =
        "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" "
        "type=\"bitmap\"><string name=\"filename\" value=\"" +
        file +
        "\"/>"
        "<float name=\"gamma\" value=\"1\"/><string name=\"channel\" value=\"" +
        channel + "\"/></texture></bsdf></shape>";
    return readScene(folder.write("a.xml", ofVersion("0.6.0", body)))
        .materials.at(0)
        .bsdf->albedo(kUp, Vec2(0.5f, 0.5f));
  };
  checkNear(value("r"), grey(1.0f));
  checkNear(value("g"), grey(0.6f));
  checkNear(value("B"), grey(0.2f));
  checkNear(value("a"), grey(0.4f));
  CHECK_THROWS_WITH(value("y"), Catch::Contains("this one has r, g, b"));
  CHECK_THROWS_WITH(value("q"), Catch::Contains("known are r, g, b, a, y"));
  folder.write("b.png", blackAndWhite());
  CHECK_THROWS_WITH(value("a", "b.png"), Catch::Contains("b.png: it has no alpha channel"));
  checkNear(value("y", "b.png"), grey(0.5f));
}

TEST_CASE("scenes: textures of the same channel of an image share it") {
  const TestFolder folder;
  folder.write("a.png", squarePng(1024));
  std::string body;
  for (int i = 0; i < 60; ++i) body += sphereWithBitmap("<string name=\"channel\" value=\"r\"/>");
  const std::filesystem::path file = folder.write("a.xml", sceneOf(body));
  const long before = peakMemory();
  const Scene scene = readScene(file);
  CHECK(peakMemory() - before < 300'000'000);  // a copy for each of them would be over 700 MB
}

// Reading the image for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: the images of a scene have a limited number of pixels", "[slow]") {
  const TestFolder folder;
  folder.write("a.png", squarePng(4096));
  std::string body;
  for (int i = 1; i <= 10000; ++i)
    body += sphereWithBitmap("<float name=\"gamma\" value=\"" + std::to_string(1 + 1e-5 * i) + "\"/>");
  body += "<texture type=\"bitmap\" id=\"none\"><string name=\"filename\" value=\"none.png\"/></texture>";
  const SceneCheck found = checkScene(folder.write("a.xml", sceneOf(body)));
  REQUIRE(found.faults.size() == 2);
  CHECK(found.faults[0].count == 10000);
  CHECK_THAT(found.faults[0].message,
             Catch::Contains("the images of the scene have more than 134217728 pixels together"));
  CHECK_THAT(found.faults[1].message, Catch::Contains("none.png: no such file"));
}

TEST_CASE("scenes: the gamma of a PNG file is used in files for Mitsuba 0.6") {
  const TestFolder folder;
  folder.write("a.png", rowPng("\x80\x80\x80", 3, chunk("gAMA", bigEndian(100000))));
  const auto value = [&](const std::string& version, const std::string& more) {
    const std::string body =
        "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" "
        "type=\"bitmap\"><string name=\"filename\" value=\"a.png\"/>" +
        more + "</texture></bsdf></shape>";
    return readScene(folder.write("a.xml", ofVersion(version, body)))
        .materials.at(0)
        .bsdf->albedo(kUp, Vec2(0.5f, 0.5f))
        .x();
  };
  const float linear = 128 / 255.0f, srgb = 0.2158605f;
  CHECK(value("0.6.0", "") == Approx(linear));
  CHECK(value("3.0.0", "") == Approx(srgb));
  CHECK(value("0.6.0", "<float name=\"gamma\" value=\"-1\"/>") == Approx(srgb));
  CHECK(value("0.6.0", "<float name=\"gamma\" value=\"2\"/>") == Approx(linear * linear));
  CHECK(value("3.0.0", "<float name=\"gamma\" value=\"0\"/>") == Approx(linear));
  CHECK(value("3.0.0", "<boolean name=\"raw\" value=\"true\"/>") == Approx(linear));
}

TEST_CASE("scenes: spots with a texture and projectors") {
  const std::string place =
      "<transform name=\"to_world\"><lookat origin=\"0 0 4\" target=\"0 0 0\" up=\"0 1 0\"/></transform>";
  const std::string board =
      "type=\"checkerboard\"><float name=\"color0\" value=\"1\"/><float name=\"color1\" value=\"0\"/></texture>";
  const Scene scene = readBody("<emitter type=\"spot\">" + place + "<texture " + board +
                               "</emitter>"
                               "<emitter type=\"projector\">" +
                               place +
                               "<float name=\"fov\" value=\"90\"/>"
                               "<float name=\"scale\" value=\"3\"/><texture name=\"irradiance\" " +
                               board + "</emitter>");
  const auto& spot = std::get<SpotLight>(scene.lights.at(0));
  REQUIRE(spot.texture);
  // The edge of the cone, 20° from the axis towards +x of the frame: to the left of the camera, −x of the world.
  const float tangent = std::tan(20 * std::numbers::pi_v<float> / 180);
  CHECK(spot.texture->uvOf(spot.direction, Vec3(-tangent, 0, -1)).isApprox(Vec2(1, 0.5f), 1e-5f));
  CHECK(spot.texture->uvOf(spot.direction, Vec3(0, -tangent, -1)).isApprox(Vec2(0.5f, 0), 1e-5f));
  const auto& projector = std::get<ProjectorLight>(scene.lights.at(1));
  CHECK(projector.scale == 3.0f);
  CHECK(projector.position == Vec3(0, 0, 4));
  // The image is upright for a viewer behind the projector: its first pixel is at the top left.
  CHECK((projector.image.uvOf(projector.direction, Vec3(-0.999f, 0.999f, -1)) - Vec2(0, 0)).norm() < 1e-3f);
  CHECK((projector.image.uvOf(projector.direction, Vec3(0.999f, -0.999f, -1)) - Vec2(1, 1)).norm() < 1e-3f);

  const TestFolder folder;
  folder.write("wide.png", blackAndWhite());  // twice as wide as high
  const Scene wide = readScene(folder.write(
      "a.xml", ofVersion("3.0.0",
                         "<emitter type=\"projector\"><float name=\"fov\" value=\"90\"/><texture name=\"irradiance\" "
                         "type=\"bitmap\"><string name=\"filename\" value=\"wide.png\"/></texture></emitter>")));
  const auto& image = std::get<ProjectorLight>(wide.lights.at(0)).image;
  CHECK(image.v.norm() == Approx(2 * image.u.norm()));
  CHECK(image.u.norm() == Approx(0.5f));
  CHECK_THAT(faultOf("<emitter type=\"projector\"/>"), Catch::Contains("irradiance"));
  CHECK_THAT(
      faultOf("<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"90\"/><texture " + board + "</emitter>"),
      Catch::Contains("below 90 degrees"));
}

TEST_CASE("scenes: a point light with a sampling_weight of 0 is left out and other weights have no effect") {
  const auto lights = [](const std::string& weight) {
    return readBody("<emitter type=\"point\"><float name=\"sampling_weight\" value=\"" + weight + "\"/></emitter>");
  };
  CHECK(lights("0.5").lights.size() == 1);
  CHECK(lights("0.5").warnings.empty());
  const Scene none = lights("0");
  CHECK(none.lights.empty());
  REQUIRE(none.warnings.size() == 1);
  CHECK_THAT(none.warnings[0], Catch::Contains("test.xml:2:23: ") && Catch::Contains("is never sampled"));
  CHECK_THAT(faultOf("<emitter type=\"point\"><float name=\"sampling_weight\" value=\"-1\"/></emitter>"),
             Catch::Contains("must not be negative"));
  // Rays hit an area light without next-event estimation.
  const Scene area = readBody(
      "<shape type=\"sphere\"><emitter type=\"area\"><float name=\"sampling_weight\" value=\"0\"/>"
      "</emitter></shape>");
  CHECK(area.shapes.at(0).emitter);
}

}  // namespace lobe
