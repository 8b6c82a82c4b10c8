// Rendering of scenes of any size, and of ellipses.

#include <fmt/format.h>

#include "runtime/render/film/camera.h"
#include "runtime/render/geometry/shape_geometry.h"
#include "tests/support/render_test_tools.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr int kSize = 16;
constexpr int kSamples = 16;

using Picture = std::vector<Rgb>;

/// Renders the scene with the same random numbers for all scenes.
Picture pictureOf(const Scene& scene) {
  const RenderScene ready(scene);
  const RayCamera camera(scene.camera, scene.filter);
  const PathIntegrator integrator(ready, {6});
  Picture picture;
  PathStatistics statistics;
  for (int pixel = 0; pixel < kSize * kSize; ++pixel) {
    Rgb sum = Rgb::Zero();
    for (int s = 0; s < kSamples; ++s) {
      Sampler rng(5, pixel, s);
      const Ray ray = camera.sample(pixel % kSize, pixel / kSize, rng);
      sum += integrator.radiance(ray, rng, statistics);
    }
    picture.push_back(sum / kSamples);
  }
  return picture;
}

double meanOf(const Picture& picture) {
  double sum = 0;
  for (const Rgb& pixel : picture) sum += luminance(pixel);
  return sum / static_cast<double>(picture.size());
}

/// Mean difference of pixels, in units of the mean pixel.
double difference(const Picture& a, const Picture& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).abs().mean();
  return sum / static_cast<double>(a.size()) / meanOf(b);
}

/// A room with edges of length 2·scale around the origin, with lamps and shapes of each kind.
class Room {
 public:
  explicit Room(double scale, bool pointLight = true) : scale_(scale) {
    for (const auto& [axis, angle] :
         {std::pair("x", -90), std::pair("x", 90), std::pair("y", 90), std::pair("y", -90), std::pair("y", 0)})
      add("rectangle", fmt::format("<translate z=\"-1\"/><rotate {}=\"1\" angle=\"{}\"/>", axis, angle), "");
    add("rectangle", "<scale value=\"0.3\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.99\"/>", emitter(8));
    add("disk", "<scale x=\"0.2\" y=\"0.1\"/><rotate y=\"1\" angle=\"90\"/><translate x=\"-0.9\"/>", emitter(5));
    add("sphere", "<scale value=\"0.3\"/><translate x=\"-0.4\" y=\"-0.7\" z=\"-0.2\"/>", "<bsdf type=\"conductor\"/>");
    add("sphere", "<scale value=\"0.05\"/><translate x=\"0.6\" y=\"0.6\" z=\"-0.5\"/>", emitter(20));
    add("cylinder", "<scale value=\"0.2\"/><translate x=\"0.1\" y=\"-0.5\" z=\"0.2\"/>", "");
    body_ +=
        "<shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\"/><shape type=\"sphere\">"
        "<point name=\"center\" x=\"0\" y=\"1.5\" z=\"0\"/><float name=\"radius\" value=\"0.5\"/></shape></shape>";
    body_ += fmt::format(
        "<shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\"><scale value=\"0.2\"/>"
        "<rotate y=\"1\" angle=\"30\"/><translate x=\"0.4\" y=\"-0.8\" z=\"0\"/><scale "
        "value=\"{}\"/></transform></shape>",
        scale);
    // Its intensity scales with the square of lengths.
    if (pointLight)
      body_ += fmt::format(
          "<emitter type=\"point\"><point name=\"position\" x=\"{}\" y=\"{}\" z=\"{}\"/><rgb name=\"intensity\" "
          "value=\"{}\"/></emitter>",
          0.5 * scale, -0.2 * scale, 0.5 * scale, 0.3 * scale * scale);
  }

  Scene read() const {
    const std::string sensor = fmt::format(
        "<sensor type=\"thinlens\"><float name=\"fov\" value=\"45\"/><float name=\"aperture_radius\" value=\"{}\"/>"
        "<float name=\"focus_distance\" value=\"{}\"/><transform name=\"to_world\"><lookat origin=\"0,0,{}\" "
        "target=\"0,0,0\" up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/>"
        "<integer name=\"height\" value=\"{}\"/></film></sensor>",
        0.05 * scale_, 3 * scale_, 3.4 * scale_, kSize, kSize);
    return readText("<scene version=\"3.0.0\">" + body_ + sensor + "</scene>");
  }

 private:
  static std::string emitter(double radiance) {
    return fmt::format("<emitter type=\"area\"><rgb name=\"radiance\" value=\"{}\"/></emitter>", radiance);
  }
  void add(const std::string& type, const std::string& place, const std::string& content) {
    body_ +=
        fmt::format("<shape type=\"{}\"><transform name=\"to_world\">{}<scale value=\"{}\"/></transform>{}</shape>",
                    type, place, scale_, content);
  }

  double scale_;
  std::string body_;
};

Picture pictureOfText(const std::string& body, const std::string& sensor) {
  Scene scene = readText("<scene version=\"3.0.0\">" + body + sensor + "</scene>");
  scene.camera.width = scene.camera.height = kSize;
  return pictureOf(scene);
}

const std::string kFromAbove =
    "<sensor type=\"orthographic\"><transform name=\"to_world\"><lookat origin=\"0,0,5\" target=\"0,0,0\" "
    "up=\"0,1,0\"/></transform></sensor>";

/// An ellipse with semi-axes 1.5 along x and 0.5 along z, which differ from u and v.
Disk ellipseAbove(float height) {
  const float c = std::cos(0.8f), s = std::sin(0.8f);
  return {{0, height, 0}, {1.5f * c, 0, 0.5f * s}, {-1.5f * s, 0, 0.5f * c}};
}

}  // namespace

TEST_CASE("render: the image does not depend on the unit of length") {
  const Picture usual = pictureOf(Room(1).read());
  CHECK(meanOf(usual) > 0.1);
  for (const double scale : {3e-10, 1e-10, 1e-6, 1e-3, 1e3, 1e6, 1e10, 1e14}) {
    CAPTURE(scale);
    CHECK(difference(pictureOf(Room(scale).read()), usual) < 0.02);
  }
}

TEST_CASE("render: scenes so small that squared lengths underflow are rendered") {
  const Picture usual = pictureOf(Room(1, false).read());
  for (const double scale : {1e-19, 1e-30}) {
    CAPTURE(scale);
    CHECK(difference(pictureOf(Room(scale, false).read()), usual) < 0.02);
  }
}

TEST_CASE("render: a camera scaled together with its scene renders the same image") {
  const auto picture = [](const std::string& type, const std::string& scale) {
    const std::string whole = "<scale value=\"" + scale + "\"/></transform>";
    return pictureOfText(
        "<emitter type=\"constant\"/><shape type=\"disk\"><transform name=\"to_world\">" + whole + "</shape>",
        "<sensor type=\"" + type +
            "\"><float name=\"aperture_radius\" value=\"0.3\"/><float name=\"focus_distance\" "
            "value=\"4\"/><transform name=\"to_world\"><lookat origin=\"0,0,2\" target=\"0,0,0\" "
            "up=\"0,1,0\"/>" +
            whole + "</sensor>");
  };
  const Picture thinlens = picture("thinlens", "1");
  CHECK(meanOf(thinlens) < 0.95);
  for (const std::string scale : {"1e-10", "1e-30", "1e10"}) {
    CAPTURE(scale);
    CHECK(difference(picture("thinlens", scale), thinlens) < 0.01);
  }
}

TEST_CASE("render: the scale of a camera's frame does not change the picture") {
  const auto picture = [](const std::string& scale) {
    return pictureOfText("<emitter type=\"constant\"/><shape type=\"disk\"/>",
                         "<sensor type=\"perspective\"><float name=\"fov\" value=\"45\"/><transform name=\"to_world\">"
                         "<scale value=\"" +
                             scale +
                             "\"/><lookat origin=\"0,0,4\" target=\"0,0,0\" up=\"0,1,0\"/></transform></sensor>");
  };
  const Picture usual = picture("1");
  CHECK(meanOf(usual) < 0.95);
  for (const std::string scale : {"1e-30", "1e-10", "1e14"}) {
    CAPTURE(scale);
    CHECK(difference(picture(scale), usual) < 0.01);
  }
}

TEST_CASE("render: scenes of ordinary size are not rescaled") {
  CHECK(Room(1).read().scale == 1);
  CHECK(Room(1e3).read().scale == 1);
  CHECK(Room(1e-10).read().scale == 0x1p32f);
}

TEST_CASE("render: bumps have the same height when a scene is scaled") {
  const Scene plain = Room(1).read(), tiny = Room(1e-10).read();
  struct Recorder : Diffuse {
    Recorder() : Diffuse(0.5f) {}
    Vec3 perturbedNormal(const Vec3&, const Vec2&, const Vec3& dpdu, const Vec3&) const override {
      length = dpdu.norm();
      return Vec3::UnitZ();
    }
    mutable float length = 0;
  };
  const auto lengthOf = [](Scene scene, float scale) {
    const auto recorder = std::make_shared<Recorder>();
    for (Material& material : scene.materials) material.bsdf = recorder;
    const RayTracer tracer(scene);
    REQUIRE(tracer.trace({Vec3(0.1f, 0.8f, 0.8f) * scale * scene.scale, Vec3(0, 0, -1)}));
    return recorder->length;
  };
  CHECK(lengthOf(tiny, 1e-10f) == Approx(1e-10f * lengthOf(plain, 1)));
}

TEST_CASE("render: shapes too small to be visible do no harm") {
  const std::string sky = "<emitter type=\"constant\"/>";
  const std::string group =
      "<shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\"/><shape type=\"sphere\"/></shape>";
  for (const std::string scale : {"1e-10", "1e-20", "1e-30", "1e-37"}) {
    CAPTURE(scale);
    const std::string place = "<transform name=\"to_world\"><scale value=\"" + scale + "\"/></transform></shape>";
    const Picture picture = pictureOfText(sky + group + "<shape type=\"instance\"><ref id=\"g\"/>" + place, kFromAbove);
    CHECK(meanOf(picture) == Approx(1));
    for (const std::string type : {"cube", "sphere", "disk", "cylinder", "rectangle"})
      CHECK(meanOf(pictureOfText(sky + "<shape type=\"" + type + "\">" + place, kFromAbove)) == Approx(1));
  }
}

TEST_CASE("render: groups of instances may have any size") {
  const auto picture = [](const std::string& inGroup, const std::string& inWorld) {
    return pictureOfText(
        "<emitter type=\"constant\"/><shape type=\"shapegroup\" id=\"g\"><shape type=\"sphere\"><float "
        "name=\"radius\" value=\"" +
            inGroup +
            "\"/></shape></shape><shape type=\"instance\"><ref id=\"g\"/><transform "
            "name=\"to_world\"><scale value=\"" +
            inWorld + "\"/></transform></shape>",
        kFromAbove);
  };
  const Picture usual = picture("0.8", "1");
  CHECK(meanOf(usual) < 0.8);
  CHECK(difference(picture("0.8e-25", "1e25"), usual) < 0.01);
  CHECK(difference(picture("0.8e14", "1e-14"), usual) < 0.01);
}

TEST_CASE("render: rays hit an ellipse inside its edge with the uv coordinates of a disk") {
  // Conjugate radii that are not orthogonal, in a tilted plane.
  const Disk ellipse{{1, 2, 3}, {2, 0, 1}, {1.5f, 0.5f, 0}};
  const Eigen::Vector3d normal = ellipse.u.cross(ellipse.v).cast<double>().normalized();
  Eigen::AlignedBox3f box = boundsOf(ellipse);
  CHECK(box.min().x() == Approx(1 - 2.5));
  CHECK(box.max().y() == Approx(2.5));
  for (int i = 0; i < 64; ++i) {
    const double azimuth = 2 * kPi * (i + 0.5) / 64;
    const auto hit = [&](double radius) {
      const Eigen::Vector3d p = ellipse.centre.cast<double>() + radius * std::cos(azimuth) * ellipse.u.cast<double>() +
                                radius * std::sin(azimuth) * ellipse.v.cast<double>();
      return intersectShape(ellipse, p + 2 * normal, -normal, {0, 10});
    };
    CHECK(hit(0.999).value() == Approx(2));
    CHECK_FALSE(hit(1.001));
  }
  Scene scene;
  addShape(scene, ellipse, -1);
  const SurfacePoint point = pointOnDisk(ellipse, 0.3f, -0.4f);
  const auto hit = RayTracer(scene).trace({point.position + normal.cast<float>(), -normal.cast<float>()});
  REQUIRE(hit);
  CHECK(hit->uv.x() == Approx(0.5).epsilon(1e-4));
  CHECK(hit->uv.y() == Approx(1 - std::atan2(0.4, 0.3) / (2 * kPi)).epsilon(1e-4));
  CHECK((hit->normal - normal.cast<float>()).norm() < 1e-5f);
}

TEST_CASE("render: irradiance from an ellipse agrees with its closed form") {
  CHECK(areaOf(ellipseAbove(1)) == Approx(kPi * 0.75));
  Scene scene;
  addShape(scene, rectangle({-50, 0, -50}, {0, 0, 100}, {100, 0, 0}),
           addMaterial(scene, std::make_shared<Diffuse>(0.6f)));
  const float height = 1.3f;
  addEmitter(scene, ellipseAbove(height), 3);
  const RenderScene ready(scene);
  const Ray ray{Vec3(1, 0.5f, 0), Vec3(-1, -0.5f, 0).normalized()};
  // Form factor of an ellipse with semi-axes a and b, from a point below its centre:
  const double h2 = height * height;
  const double fraction = 1.5 * 0.5 / std::sqrt((h2 + 2.25) * (h2 + 0.25));
  CHECK(deviation(estimate(PathIntegrator(ready, {2}), ray, 40000), 0.6 * 3 * fraction) < kMaxDeviation);
}

TEST_CASE("render: a scene shows a disk under a non-uniform scale as an ellipse") {
  // The black ellipse with semi-axes 0.4 and 0.8 covers π·0.32 of the visible area of 4.
  const Picture picture = pictureOfText(
      "<emitter type=\"constant\"/><shape type=\"disk\"><transform name=\"to_world\"><scale x=\"0.4\" y=\"0.8\"/>"
      "</transform><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0\"/></bsdf></shape>",
      kFromAbove);
  CHECK(meanOf(picture) == Approx(1 - kPi * 0.32 / 4).margin(0.02));
}
