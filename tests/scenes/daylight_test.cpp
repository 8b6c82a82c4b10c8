// The sun's position, clear sky and sun, and the environment map that is made from them.

#include <chrono>
#include <cmath>
#include <numbers>
#include <thread>

#include <catch2/catch.hpp>

#include "runtime/core/parallel.h"
#include "scenes/daylight/daylight_image.h"
#include "scenes/daylight/sun_position.h"
#include "tests/support/scenes_test_tools.h"

namespace lobe {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kLumens = 683 * 106.856980;  // from W/(m² sr nm) to cd/m²

Vector3d at(double zenith, double azimuth = 0) {
  const double t = zenith * kDegree, p = azimuth * kDegree;
  return {std::sin(p) * std::sin(t), std::cos(t), -std::cos(p) * std::sin(t)};
}

/// ∫ radiance · (1, direction) dω of the bilinearly interpolated image, by a fine midpoint rule over the weights of
/// each row, independent of the closed forms that were used to make the image.
struct Integral {
  Vector3d power = Vector3d::Zero();
  Vector3d direction = Vector3d::Zero();  // weighted by the green channel
  double ground = 0;                      // likewise, with the cosine to +y above the horizon
};
Integral integrate(const Image& image) {
  constexpr int kParts = 200;
  const double step = std::numbers::pi / image.height, column = 2 * std::numbers::pi / image.width;
  Integral sum;
  for (int y = 0; y < image.height; ++y) {
    double solidAngle = 0, up = 0, across = 0;
    for (int k = 0; k < 3 * kParts; ++k) {
      const double row = y - 1 + (k + 0.5) / kParts;
      if (row < 0 || row > image.height) continue;
      const bool pole = (y == 0 && row < 0.5) || (y == image.height - 1 && row > image.height - 0.5);
      const double weight = pole ? 1 : std::max(0.0, 1 - std::abs(row - y - 0.5));
      const double part = weight * std::sin(row * step) * step / kParts * column;
      solidAngle += part, up += part * std::cos(row * step), across += part * std::sin(row * step);
    }
    for (int x = 0; x < image.width; ++x) {
      const Vector3d value = image.at(x, y).matrix().cast<double>();
      const double azimuth = (x + 0.5) * column;
      sum.power += solidAngle * value;
      sum.direction += value.y() * Vector3d(across * std::sin(azimuth), up, -across * std::cos(azimuth));
      sum.ground += value.y() * std::max(0.0, up);
    }
  }
  return sum;
}

Environment bakeSun(const SunDisc& sun, int width = 256) {
  return bakeDaylight({{}, {sun}}, Eigen::Matrix3d::Identity(), width);
}

}  // namespace

TEST_CASE("scenes: the position of the sun agrees with almanacs") {
  DateAndPlace equinox{2010, 3, 20, 12, 7.5, 0, 0, 0, 0};  // solar noon is late by the equation of time
  CHECK(sunDirection(equinox).y() > std::cos(0.2 * kDegree));
  DateAndPlace solstice{2010, 6, 21, 12, 1.8, 0, 0, 23.437, 0};
  CHECK(sunDirection(solstice).y() > std::cos(0.1 * kDegree));
  solstice.latitude = 90;
  CHECK(std::asin(sunDirection(solstice).y()) == Approx(23.437 * kDegree).margin(0.02 * kDegree));
  // Mitsuba's default: Tokyo in the afternoon, the sun in the west, a little to the south.
  const Vector3d tokyo = sunDirection({});
  CHECK(tokyo.x() < -0.6);
  CHECK(tokyo.z() > 0);
  DateAndPlace later;
  later.longitude += 15, later.timezone += 1, later.hour += 1;
  CHECK((sunDirection(later) - tokyo).norm() < 0.27);  // the earth has turned by an hour
  CHECK((sunDirection(later) - tokyo).norm() > 1e-3);
  later.longitude -= 15;
  CHECK((sunDirection(later) - tokyo).norm() < 1e-12);  // the same moment in another time zone
}

TEST_CASE("scenes: Preetham's sky has the zenith luminance of its formula") {
  // Turbidity 3, sun 60° from the zenith: χ = (4/9 − 3/120) π/3, Y = 7.1649 tan χ + 1.7727 kcd/m².
  const PreethamSky sky(3, at(60));
  const double zenith = 1000 * (7.1649 * std::tan((4.0 / 9 - 0.025) * std::numbers::pi / 3) + 1.7727);
  CHECK(zenith == Approx(5139).epsilon(1e-3));
  CHECK(sky.zenithLuminance() == Approx(zenith).epsilon(1e-9));
  CHECK(luminance(sky.radiance(Vector3d::UnitY())) * kLumens == Approx(zenith).epsilon(1e-4));
  const Rgb blue = sky.radiance(Vector3d::UnitY());
  CHECK((blue.z() > blue.y() && blue.y() > blue.x()));
  // Brightest around the sun, black at and below the horizon.
  CHECK(luminance(sky.radiance(at(60, 5))) > 3 * luminance(sky.radiance(at(60, 180))));
  CHECK((sky.radiance(at(90.001)) == 0.0f).all());
  for (const double turbidity : {2.0, 4.0, 10.0})
    for (const double sun : {0.0, 45.0, 80.0, 90.0})
      for (int step = 0; step < 19; ++step) {
        const double polar = 4.9 * step;
        const Rgb radiance = PreethamSky(turbidity, at(sun)).radiance(at(polar, 3 * polar));
        CHECK(radiance.isFinite().all());
        CHECK(radiance.minCoeff() >= 0);
        CHECK(radiance.maxCoeff() > 0);
      }
}

TEST_CASE("scenes: sunlight has its measured illuminance") {
  const double half = std::sin(0.5 * sunRadius());
  const double solidAngle = 4 * std::numbers::pi * half * half;
  CHECK(solidAngle == Approx(6.87e-5).epsilon(1e-3));
  const auto lux = [&](double turbidity, double zenith) {
    return luminance(sunRadiance(turbidity, zenith * kDegree)) * solidAngle * kLumens;
  };
  // 128 klx outside the atmosphere, about 100 klx at sea level under a high sun; the setting sun is red.
  CHECK(lux(1, 0) < 128e3);
  CHECK(lux(2, 0) == Approx(103e3).epsilon(0.03));
  CHECK(lux(3, 30) == Approx(88e3).epsilon(0.05));
  CHECK(lux(3, 30) > lux(3, 60));
  CHECK(lux(3, 60) > lux(5, 60));
  const Rgb setting = sunRadiance(3, 85 * kDegree);
  CHECK(setting.x() > 3 * setting.z());
  CHECK(sunRadiance(10, 90 * kDegree).isFinite().all());
}

TEST_CASE("scenes: the environment map has the sun's irradiance for any radius and position") {
  const Rgb irradiance(1, 2, 3);
  for (const Vector3d& sun : {at(0), at(0.1, 30), at(0.7), at(44, 100), at(60, 0.01), at(89.9, 270), at(180)})
    for (const double radius : {0.01, 1.0, 4.0, 30.0}) {
      const Integral sum = integrate(bakeSun({sun, irradiance, radius * sunRadius()}).radiance);
      INFO(sun.transpose() << " at " << radius);
      CHECK((sum.power - Vector3d(1, 2, 3)).norm() < 1e-3);
      // A disc has slightly less irradiance in the direction of its centre.
      const double mean = 0.5 * (1 + std::cos(radius * sunRadius()));
      // Within a pixel of a pole, the azimuth is poorly defined.
      const bool pole = std::hypot(sun.x(), sun.z()) < std::numbers::pi / 128;
      CHECK((sum.direction / 2 - mean * sun).norm() < (pole ? std::numbers::pi / 128 : 1e-3));
    }
  // On the ground, exactly the irradiance times the cosine.
  const Integral sum = integrate(bakeSun({at(60, 123), irradiance, sunRadius()}, 1024).radiance);
  CHECK(sum.ground == Approx(2 * std::cos(60 * kDegree)).epsilon(1e-3));
}

// All suns would take far longer than the time limit of a test.
TEST_CASE("scenes: the suns of an environment map end early in a cancelled task") {
  const std::vector<SunDisc> suns(3000, SunDisc{at(10), Rgb(1, 1, 1), 90 * kDegree});
  tbb::task_group_context context(tbb::task_group_context::isolated);
  tbb::task_group group(context);
  std::thread interruption([&context] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    context.cancel_group_execution();
  });
  bool cancelled = false;
  group.run_and_wait([&] {
    try {
      bakeDaylight({{}, suns}, Eigen::Matrix3d::Identity(), 1024);
    } catch (const LoopCancelled&) {
      cancelled = true;
    }
  });
  interruption.join();
  CHECK(cancelled);
}

TEST_CASE("scenes: the environment map has the irradiance of the sky") {
  const PreethamSky sky(3, at(50, 70));
  const Environment baked =
      bakeDaylight({{{sky, Eigen::Matrix3d::Identity(), 2, 1}}, {}}, Eigen::Matrix3d::Identity(), 512);
  double ground = 0;
  constexpr int kSteps = 500;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double rise = std::sqrt((i + 0.5) / kSteps);  // cosine, in equal steps of its square
      ground += sky.radiance(at(std::acos(rise) / kDegree, 360 * (j + 0.5) / kSteps)).y();
    }
  ground *= std::numbers::pi / kSteps / kSteps;
  CHECK(integrate(baked.radiance).ground == Approx(2 * ground).epsilon(2e-3));
}

TEST_CASE("scenes: skies and suns of a file are added to one environment") {
  const std::string place =
      "<vector name=\"sunDirection\" x=\"0.6\" y=\"0.8\"/><integer name=\"resolution\" value=\"64\"/>";
  const auto emitter = [&](const std::string& type, const std::string& more = "") {
    return "<emitter type=\"" + type + "\">" + place + more + "</emitter>";
  };
  const auto imageOf = [](const std::string& body) { return readBody(body).environment.value().radiance; };
  const Image both =
      imageOf(emitter("sunsky", "<float name=\"skyScale\" value=\"3\"/><float name=\"scale\" value=\"2\"/>"));
  const Image sum = imageOf(emitter("sky", "<float name=\"scale\" value=\"3\"/>") +
                            emitter("sun", "<float name=\"scale\" value=\"2\"/>"));
  CHECK(both.width == 64);
  CHECK(both.height == 32);
  double difference = 0;
  for (std::size_t i = 0; i < both.pixels.size(); ++i)
    difference += (both.pixels[i] - sum.pixels[i]).abs().sum() / (both.pixels[i].sum() + 1e-9);
  CHECK(difference < 1e-3);
  CHECK(imageOf("<emitter type=\"sky\"/>").width == 1024);

  // The sun's direction is in world space and independent of the rotation of the sky.
  const std::string turn = "<transform name=\"toWorld\"><rotate y=\"1\" angle=\"70\"/></transform>";
  const Environment turned = readBody(emitter("sun", turn)).environment.value();
  const Vector3d seen = turned.toWorld.cast<double>() * integrate(turned.radiance).direction.normalized();
  CHECK((seen - Vector3d(0.6, 0.8, 0)).norm() < 3e-3);  // one of 64 pixels is 0.1

  // Without a radius it is a directional light of the same irradiance.
  const Scene sharp = readBody(emitter("sunsky", "<float name=\"sunRadiusScale\" value=\"0\"/>"));
  const auto& light = std::get<DirectionalLight>(sharp.lights.at(0));
  CHECK((light.direction - Vec3(-0.6f, -0.8f, 0)).norm() < 1e-6f);
  CHECK(light.irradiance.y() == Approx(integrate(imageOf(emitter("sun"))).power.y()).epsilon(1e-3));

  const Scene clear =
      readBody(emitter("sky", "<float name=\"turbidity\" value=\"1\"/><float name=\"albedo\" value=\"0.5\"/>"));
  REQUIRE(clear.notes.size() == 2);
  CHECK(clear.notes[0].find("zenith is +y") != std::string::npos);
  REQUIRE(clear.warnings.size() == 1);
  CHECK(clear.warnings[0].find("albedo is ignored") != std::string::npos);
  // A disc of 2 degrees in diameter, as given in Mitsuba 3 and in 0.6: 3.733 times that of the sun.
  const Image wide = imageOf(emitter("sun", "<float name=\"sun_aperture\" value=\"2\"/>"));
  const Image scaled = imageOf(emitter("sun", "<float name=\"sunRadiusScale\" value=\"3.73273610\"/>"));
  CHECK(integrate(wide).power.y() == Approx(integrate(imageOf(emitter("sun"))).power.y()).epsilon(1e-3));
  difference = 0;
  for (std::size_t i = 0; i < wide.pixels.size(); ++i) difference += (wide.pixels[i] - scaled.pixels[i]).abs().sum();
  CHECK(difference < 1e-3 * integrate(wide).power.y());
  ReadOptions materialsOnly;
  materialsOnly.geometry = false;
  CHECK_FALSE(readBody(emitter("sky"), materialsOnly).environment);
}

TEST_CASE("scenes: a stretched sky reaches below the horizon") {
  const auto below = [](double stretch) {
    const SkyDome dome{PreethamSky(3, at(40)), Eigen::Matrix3d::Identity(), 1, stretch};
    return bakeDaylight({{dome}, {}}, Eigen::Matrix3d::Identity(), 64).radiance.at(10, 20).y();  // 115° from the zenith
  };
  CHECK(below(1) == 0);
  CHECK(below(1.2) == 0);
  CHECK(below(1.5) > 0);
}

}  // namespace lobe
