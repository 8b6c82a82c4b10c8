// Emission of area lights in scene files, compared with closed forms.

#include "tests/support/render_test_tools.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

/// Form factor of an a×b rectangle at height 1, from a point below one of its corners.
double cornerFactor(double a, double b) {
  const double p = std::sqrt(1 + a * a), q = std::sqrt(1 + b * b);
  return (a / p * std::atan(b / p) + b / q * std::atan(a / q)) / (2 * kPi);
}

/// Radiance of a floor of reflectance 0.8 below a corner of a 2×2 lamp at height 1.
Rgb seenOnFloor(const std::string& radiance) {
  const Scene scene = readBody(
      "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" angle=\"-90\"/><scale value=\"50\"/>"
      "</transform><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"300:0.8, 900:0.8\"/></bsdf></shape>"
      "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" angle=\"90\"/>"
      "<translate x=\"1\" y=\"1\" z=\"1\"/></transform><emitter type=\"area\">" +
      radiance + "</emitter></shape>");
  const RenderScene ready(scene);
  const PathIntegrator integrator(ready, {2});
  const Ray ray{Vec3(-0.5f, 0.5f, 0), Vec3(1, -1, 0).normalized()};
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  PathStatistics statistics;
  constexpr int kSamples = 1 << 18;
  for (int i = 0; i < kSamples; ++i) {
    Sampler rng(11, 0, i);
    sum += integrator.radiance(ray, rng, statistics).cast<double>();
  }
  return (sum / kSamples).cast<float>();
}

void checkFraction(const Rgb& seen, const Rgb& expected) {
  INFO(seen.transpose() << " is not " << expected.transpose());
  CHECK(((seen - expected).abs() <= 0.005f * expected).all());
}

}  // namespace

TEST_CASE("render: a lamp with a spectrum lights a floor in its colour to half a percent") {
  const float fraction = 0.8f * static_cast<float>(cornerFactor(2, 2));
  // Expected values: sums over the CIE observer's table, in steps of one nanometre.
  checkFraction(seenOnFloor("<spectrum name=\"radiance\" value=\"400:0, 500:8, 600:15.6, 700:18.4\"/>"),
                fraction * Rgb(20.714f, 10.854f, 2.771f));
  checkFraction(seenOnFloor("<spectrum name=\"radiance\" value=\"360:1, 830:1\"/>"),
                fraction * Rgb(1.205f, 0.948f, 0.909f));
  checkFraction(seenOnFloor("<rgb name=\"radiance\" value=\"1, 2, 3\"/>"), fraction * Rgb(1, 2, 3));
}

TEST_CASE("render: a lamp with a texture lights a floor to half a percent") {
  // Squares of 1×1; the nearest and the farthest have the same colour, so swapping u and v changes nothing.
  const double near = cornerFactor(1, 1), beside = cornerFactor(2, 1) - near,
               far = cornerFactor(2, 2) - near - 2 * beside;
  const auto fraction = [](double factor) { return 0.8f * static_cast<float>(factor); };
  checkFraction(seenOnFloor("<texture name=\"radiance\" type=\"checkerboard\"><rgb name=\"color0\" value=\"3, 2, 0\"/>"
                            "<rgb name=\"color1\" value=\"0, 1, 4\"/></texture>"),
                fraction(near + far) * Rgb(3, 2, 0) + fraction(2 * beside) * Rgb(0, 1, 4));
}
