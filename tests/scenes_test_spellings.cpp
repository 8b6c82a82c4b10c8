// What exporters and several versions of Mitsuba write in their own ways.

#include <catch2/catch.hpp>

#include "scenes_test_tools.h"

namespace lobe {
namespace {

const Vec3 kUp = Vec3::UnitZ();

std::string sceneOfVersion(const std::string& version, const std::string& body) {
  return "<scene version=\"" + version + "\">\n" + body + "\n" + kSensor + "\n</scene>\n";
}

/// Of the first material, straight from above.
Rgb albedoOf(const Scene& scene) {
  return scene.materials.at(0).bsdf->albedo(kUp, Vec2(0.25f, 0.25f));
}

std::string sphere(const std::string& bsdf) {
  return "<shape type=\"sphere\">" + bsdf + "</shape>";
}

}  // namespace

TEST_CASE("scenes: a metal that is not named is copper to Mitsuba 0.6 and a mirror to Mitsuba 3") {
  for (const std::string type : {"conductor", "roughconductor"}) {
    const std::string body = sphere("<bsdf type=\"twosided\"><bsdf type=\"" + type + "\"/></bsdf>");
    for (const std::string version : {"2.0.0", "3.5.2"})
      CHECK(albedoOf(readText(sceneOfVersion(version, body))).isApprox(grey(1.0f)));
    for (const std::string version : {"0.4.0", "0.6.0"})
      CHECK(albedoOf(readText(sceneOfVersion(version, body))).z() < 0.6f);
    const std::string copper = sphere("<bsdf type=\"" + type + "\"><string name=\"material\" value=\"Cu\"/></bsdf>");
    CHECK(albedoOf(readBody(copper)).z() < 0.6f);
  }
  // Given only η, there k is 1: ((η − 1)² + 1) / ((η + 1)² + 1), but for the air outside.
  const Scene half = readBody(sphere("<bsdf type=\"conductor\"><rgb name=\"eta\" value=\"2, 2, 2\"/></bsdf>"));
  CHECK(albedoOf(half).x() == Approx(0.2f).epsilon(1e-3));
}

TEST_CASE("scenes: colours out of any range are refused at their place") {
  const auto fault = [](const std::string& body) { return faultOf("\n" + body); };
  for (const std::string value : {"-0.5", "0.2, -0.1, 0.3"})
    CHECK_THAT(fault(sphere("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"" + value + "\"/></bsdf>")),
               Catch::StartsWith("test.xml:3:43: ") && Catch::Contains("reflectance must be finite and not negative"));
  const std::string radiance = "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"";
  for (const std::string value : {"-1", "1e31", "1, 2, 1e200"})
    CHECK_THAT(fault(radiance + value + "\"/></emitter>"),
               Catch::StartsWith("test.xml:3:26: ") && Catch::Contains("neither negative nor over 1e+30"));
}

}  // namespace lobe
