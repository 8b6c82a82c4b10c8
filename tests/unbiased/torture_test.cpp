// Extreme scenes: with every integrator the samples are finite and not negative, and guided images agree with path
// tracing, with learnt counts of samples, which are the default of the tools, and with Russian roulette by throughput.
//
//   unbiased_tests "torture*" -s | grep ' z '
//
// prints the z and p-value of each scene and method.

#include <catch2/catch.hpp>

#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "runtime/image/image_output.h"
#include "tests/support/agreement.h"
#include "tests/support/studio.h"

namespace lobe::test {
namespace {

/// A scene under extreme conditions.
struct Torture {
  std::string name, body;
  int width = 12, height = 8;
  int maxDepth = 12;
  int samples = 64;    ///< per pixel of each guided image; that of path tracing has four times as many
  bool guided = true;  ///< there are records, and the picture is not black
};

std::string rgb(const std::string& name, double value) {
  return fmt::format("<rgb name=\"{}\" value=\"{}\"/>", name, value);
}

std::string diffuse(double reflectance) {
  return "<bsdf type=\"diffuse\">" + rgb("reflectance", reflectance) + "</bsdf>";
}

std::string metal(double alpha) {
  return fmt::format(
      "<bsdf type=\"roughconductor\"><string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\"{}\"/>"
      "</bsdf>",
      alpha);
}

/// From `origin` to `target`, z up.
std::string camera(const std::string& origin, const std::string& target, const std::string& more = "") {
  return fmt::format(
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"50\"/><transform name=\"to_world\">"
      "<lookat origin=\"{}\" target=\"{}\" up=\"0,0,1\"/></transform>{}</sensor>",
      origin, target, more);
}

std::string square(const std::string& transform, const std::string& content) {
  return "<shape type=\"rectangle\"><transform name=\"to_world\">" + transform + "</transform>" + content + "</shape>";
}

std::string lamp(double radiance) {
  return "<emitter type=\"area\">" + rgb("radiance", radiance) + "</emitter>";
}

const std::string kLamp = square("<scale value=\"0.7\"/><rotate x=\"1\" angle=\"180\"/><translate z=\"3\"/>", lamp(6));
const std::string kSky = "<emitter type=\"constant\">" + rgb("radiance", 0.3) + "</emitter>";
const std::string kWall =
    square("<scale value=\"3\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"2\" z=\"2\"/>", diffuse(0.7));
const std::string kCamera = camera("0,-5,2", "0,0,0.7");

std::string floorOf(const std::string& bsdf) {
  return square("<scale value=\"3\"/>", bsdf);
}

std::string ball(const std::string& centre, double radius, const std::string& bsdf) {
  return fmt::format(
      "<shape type=\"sphere\"><point name=\"center\" value=\"{}\"/><float name=\"radius\" value=\"{}\"/>{}</shape>",
      centre, radius, bsdf);
}

/// A floor of this material, a wall and a ball under a lamp and a dim sky.
std::string studioOf(const std::string& bsdf) {
  return kCamera + floorOf(bsdf) + kWall + ball("0,0,0.7", 0.7, bsdf) + kLamp + kSky;
}

void checkFilm(const Film& film) {
  CHECK(film.dropped() == 0);
  for (const Rgb& pixel : film.mean().pixels) REQUIRE((pixel.allFinite() && pixel.minCoeff() >= 0));
}

/// A guided image. counts: null for Russian roulette by throughput.
struct Method {
  std::string name;
  const GuidedSampler& guide;
  const SampleCountModel* counts;
};

std::vector<Method> methodsOf(const Studio& studio) {
  return {{"guided", studio.guidedSampler(), &studio.guidedCounts()},
          {"product", studio.productSampler(), &studio.productCounts()},
          {"guided by throughput", studio.guidedSampler(), nullptr},
          {"product by throughput", studio.productSampler(), nullptr}};
}

/// Compares with the image of path tracing.
void check(const Film& path, const Film& film, int size, const std::string& name) {
  checkFilm(film);
  const ZTest test = zTest(blocks(path, size), blocks(film, size));
  INFO(fmt::format("{}: z {:.2f}, p {:.3g}", name, test.worst, test.p));
  CAPTURE(test.together, test.ratio);
  CHECK(test.passes());
}

void check(const Torture& torture, const Folder& folder) {
  CAPTURE(torture.name);
  std::ofstream(folder / "scene.xml") << "<scene version=\"3.0.0\">" + torture.body + "</scene>";
  const Studio studio(readScene(folder / "scene.xml"), torture.width, torture.height);
  PathOptions options;
  options.maxDepth = torture.maxDepth;
  const int size = std::min(3, torture.height);
  const RenderScene& scene = studio.renderScene();
  const Film path = studio.render(PathIntegrator(scene, options), 4 * torture.samples, 1);
  checkFilm(path);
  if (torture.guided) {
    CHECK(studio.illumination().size() > 10);
    CHECK(path.mean().pixels.front().sum() + path.mean().pixels.back().sum() > 0);
  }
  std::uint64_t seed = 2;
  for (const Method& method : methodsOf(studio)) {
    options.counts = method.counts;
    const Film film = studio.render(GuidedIntegrator(scene, options, method.guide), torture.samples, seed++);
    check(path, film, size, torture.name + ", " + method.name);
  }
}

void check(const std::vector<Torture>& all) {
  const Folder folder;
  for (const Torture& torture : all) check(torture, folder);
}

}  // namespace

TEST_CASE("torture: roughness from 0.0001 to 1", "[slow]") {
  std::vector<Torture> all;
  for (const double alpha : {1e-4, 1e-3, 1e-2, 0.1, 1.0})
    all.push_back({fmt::format("alpha {}", alpha), studioOf(metal(alpha)), 12, 8, 12, 128});
  check(all);
}

TEST_CASE("torture: grazing views, black and amplifying surfaces", "[slow]") {
  const std::string grazing = camera("0,-2.9,0.0005", "0,0,0.0004");
  const std::string black = "<bsdf type=\"roughconductor\">" + rgb("specular_reflectance", 0) + "</bsdf>";
  const std::string bright = "<bsdf type=\"roughconductor\"><float name=\"alpha\" value=\"0.3\"/>" +
                             rgb("specular_reflectance", 2) + "</bsdf>";
  check(
      {{"grazing metal", grazing + floorOf(metal(0.05)) + kWall + kLamp + kSky},
       {"grazing plastic", grazing +
                               floorOf("<bsdf type=\"roughplastic\"><float name=\"alpha\" value=\"0.1\"/></bsdf>") +
                               kWall + kLamp + kSky},
       {"black metal", studioOf(black)},
       {"black everywhere", kCamera + floorOf(diffuse(0)) + ball("0,0,1", 1, diffuse(0)) + kLamp, 12, 8, 12, 64, false},
       {"energy over 1", studioOf(bright), 12, 8, 4}});
}

TEST_CASE("torture: cameras in glass, tiny images and long paths", "[slow]") {
  const std::string glass = "<bsdf type=\"dielectric\"/>",
                    frosted = "<bsdf type=\"roughdielectric\"><float name=\"alpha\" value=\"0.2\"/></bsdf>";
  const std::string box =
      "<shape type=\"cube\"><boolean name=\"flip_normals\" value=\"true\"/>" + diffuse(0.9) + "</shape>";
  const std::string inBox =
      camera("0,-0.9,0", "0,0,0.1") + box +
      square("<scale value=\"0.3\"/><rotate x=\"1\" angle=\"180\"/><translate z=\"0.99\"/>", lamp(3));
  const std::string pinhole =
      "<sensor type=\"thinlens\"><float name=\"fov\" value=\"50\"/><float name=\"aperture_radius\" value=\"1e-8\"/>"
      "<float name=\"focus_distance\" value=\"5\"/><transform name=\"to_world\"><lookat origin=\"0,-5,2\" "
      "target=\"0,0,0.7\" up=\"0,0,1\"/>"
      "</transform></sensor>";
  check({{"inside glass", studioOf(metal(0.3)) + ball("0,-5,2", 0.4, glass), 12, 8, 12, 128},
         {"inside frosted glass", studioOf(metal(0.3)) + ball("0,-5,2", 0.4, frosted), 12, 8, 12, 128},
         {"one pixel", studioOf(metal(0.3)), 1, 1, 12, 1000},
         {"100 bounces", inBox, 12, 8, 101},
         {"pinhole", pinhole + floorOf(metal(0.2)) + kWall + kLamp}});
}

TEST_CASE("torture: nothing to see, degenerate shapes and invalid pixels", "[slow]") {
  const Folder folder;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Image image(4, 2, grey(0.5f));
  image.at(1, 0) = Rgb(nan, 1, -3);
  image.at(2, 1) = grey(-7);
  writeImage(folder / "bad.exr", image);
  std::ofstream(folder / "flat.obj") << "v 0 0 1\nv 1 0 1\nv 2 0 1\nv 0 1 1\nf 1 2 3\nf 1 1 1\nf 1 2 4\nf 1 4 1\n";
  const std::string texture =
      "<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\"><string name=\"filename\" "
      "value=\"bad.exr\"/></texture></bsdf>";
  const std::string mesh = "<shape type=\"obj\"><string name=\"filename\" value=\"flat.obj\"/>";
  for (const Torture& torture : std::vector<Torture>{
           {"empty", kCamera, 12, 8, 12, 64, false},
           {"only a sky", kCamera + kSky, 12, 8, 12, 64, false},
           {"no light", kCamera + floorOf(metal(0.1)), 12, 8, 12, 64, false},
           {"invalid texels", kCamera + floorOf(texture) + kWall + kLamp},
           {"invalid sky", kCamera + floorOf(metal(0.2)) + kWall +
                               "<emitter type=\"envmap\"><string name=\"filename\" value=\"bad.exr\"/></emitter>"},
           {"degenerate triangles", studioOf(metal(0.3)) + mesh + metal(0.2) + "</shape>"},
           {"a lamp with triangles without area", kCamera + floorOf(metal(0.3)) + kWall + mesh + lamp(3) + "</shape>"},
           {"a lamp of almost no area",
            studioOf(diffuse(0.5)) + square("<scale value=\"1e-12\"/><translate z=\"2\"/>", lamp(5))}})
    check(torture, folder);
}

TEST_CASE("torture: 10,000 lights, 10,000 emitting triangles and 5,000 materials", "[slow]") {
  std::string lights, triangles, squares;
  for (int i = 0; i < 10000; ++i)
    lights +=
        fmt::format("<emitter type=\"point\"><point name=\"position\" value=\"{},{},{}\"/>{}</emitter>",
                    i % 100 * 0.05 - 2.5, i / 100 * 0.04 - 2, 2 + i % 7 * 0.1, rgb("intensity", 1e-3 * (1 + i % 5)));
  for (int i = 0; i < 10000; ++i) {
    // Facing down, above what the camera sees.
    const double x = i % 100 * 0.05 - 2.5, y = i / 100 * 0.04 - 2, z = 3 + i % 7 * 0.1;
    triangles += fmt::format("v {} {} {}\nv {} {} {}\nv {} {} {}\nf {} {} {}\n", x, y, z, x, y + 0.01, z, x + 0.01, y,
                             z, 3 * i + 1, 3 * i + 2, 3 * i + 3);
  }
  const Folder folder;
  std::ofstream(folder / "lamps.obj") << triangles;
  const std::string lamps =
      "<shape type=\"obj\"><string name=\"filename\" value=\"lamps.obj\"/>" + lamp(20) + "</shape>";
  for (int i = 0; i < 5000; ++i) {
    const std::string colour = fmt::format("<rgb name=\"specular_reflectance\" value=\"{}\"/>", 0.2 + i * 0.00015);
    squares += square(fmt::format("<scale value=\"0.04\"/><translate value=\"{},{},0.01\"/>", i % 100 * 0.06 - 3,
                                  i / 100 * 0.1 - 2.5),
                      fmt::format("<bsdf type=\"roughconductor\"><float name=\"alpha\" value=\"{}\"/>{}</bsdf>",
                                  0.1 + i % 3 * 0.1, colour));
  }
  for (const Torture& torture :
       std::vector<Torture>{{"lights", kCamera + floorOf(metal(0.3)) + kWall + lights, 12, 8, 4},
                            {"emitting triangles", kCamera + floorOf(metal(0.3)) + kWall + lamps, 12, 8, 4},
                            {"materials", kCamera + floorOf(diffuse(0.5)) + kWall + squares + kLamp}})
    check(torture, folder);
}

TEST_CASE("torture: a lamp with every triangle twice", "[slow]") {
  const Folder folder;
  std::ofstream(folder / "twice.obj") << "v -0.7 -0.7 3\nv 0.7 -0.7 3\nv 0.7 0.7 3\nv -0.7 0.7 3\n"
                                         "f 1 3 2\nf 1 4 3\nf 3 2 1\nf 4 3 1\n";
  const std::string twice =
      "<shape type=\"obj\"><string name=\"filename\" value=\"twice.obj\"/>" + lamp(6) + "</shape>";
  check({"every triangle twice", kCamera + floorOf(metal(0.3)) + kWall + ball("0,0,0.7", 0.7, metal(0.1)) + twice},
        folder);
  const std::vector<std::string> notes = readScene(folder / "scene.xml").notes;
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0], Catch::Contains("2 triangles are equal to others of it"));
}

TEST_CASE("torture: scenes of any size", "[slow]") {
  std::vector<Torture> all;
  for (const double scale : {1e-5, 1e-2, 1e3, 1e6}) {
    const auto at = [&](double x, double y, double z) {
      return fmt::format("{},{},{}", scale * x, scale * y, scale * z);
    };
    const auto scaled = [&](double size, const std::string& turn, const std::string& place,
                            const std::string& content) {
      return square(fmt::format("<scale value=\"{}\"/>{}<translate value=\"{}\"/>", scale * size, turn, place),
                    content);
    };
    all.push_back(
        {fmt::format("scale {}", scale), camera(at(0, -5, 2), at(0, 0, 0.7)) + scaled(3, "", at(0, 0, 0), metal(0.2)) +
                                             scaled(3, "<rotate x=\"1\" angle=\"90\"/>", at(0, 2, 2), diffuse(0.7)) +
                                             scaled(0.7, "<rotate x=\"1\" angle=\"180\"/>", at(0, 0, 3), lamp(6)) +
                                             ball(at(0, 0, 0.7), 0.7 * scale, "<bsdf type=\"dielectric\"/>")});
  }
  check(all);
}

}  // namespace lobe::test
