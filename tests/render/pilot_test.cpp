// The comparison of integrators by which loberender chooses one.

#include <array>
#include <limits>

#include <catch2/catch.hpp>

#include "runtime/render/integrators/pilot.h"
#include "scenes/camera.h"

namespace {

using namespace lobe;

/// Radiance 1 with noise: uniform in [1 − noise, 1 + noise], by independent numbers; `segments` per path.
class Noisy : public Integrator {
 public:
  Noisy(float noise, int segments) : noise_(noise), segments_(segments) {}
  Rgb radiance(const Ray&, Sampler& rng, PathStatistics& statistics) const override {
    statistics.segments += static_cast<std::uint64_t>(segments_);
    return Rgb::Constant(1 + noise_ * (2 * rng.uniform() - 1));
  }

 private:
  float noise_;
  int segments_;
};

/// Noise in the right quarter of the image only.
class NoisyAtTheRight : public Integrator {
 public:
  explicit NoisyAtTheRight(float firstX) : firstX_(firstX) {}
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics&) const override {
    const bool noisy = ray.direction.x() / ray.direction.z() < firstX_;
    return Rgb::Constant(1 + (noisy ? 2 * rng.uniform() - 1 : 0));
  }

 private:
  float firstX_;  // of the direction at distance 1
};

/// Noisy, with a few samples of another value.
class Faulty : public Noisy {
 public:
  Faulty(float noise, float value) : Noisy(noise, 1), value_(value) {}
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const override {
    const Rgb sample = Noisy::radiance(ray, rng, statistics);
    return rng.uniform() < 1e-3f ? Rgb(Rgb::Constant(value_)) : sample;
  }

 private:
  float value_;
};

RayCamera cameraOf(int width, int height) {
  Camera camera;
  camera.width = width, camera.height = height;
  return {camera, {}};
}

}  // namespace

TEST_CASE("pilot: variance and cost of integrators are those of their samples") {
  const Noisy little(0.3f, 4), much(0.9f, 1);
  const std::array<const Integrator*, 2> both{&little, &much};
  const auto results = comparePilots(cameraOf(160, 90), both, {.tiles = 128, .samples = 8, .seed = 3});
  REQUIRE(results.size() == 2);
  // A mean of 8 uniform numbers has variance noise² / 24; the squared mean is 1 + ¼. The worst pixels are left out.
  CHECK(results[0].variance == Approx(0.09 / 24 / 1.25).epsilon(0.1));
  CHECK(results[1].variance == Approx(0.81 / 24 / 1.25).epsilon(0.1));
  CHECK(results[0].cost == Approx(4));
  CHECK(results[1].cost == Approx(1));
  CHECK(results[0].inefficiency() < results[1].inefficiency());
}

TEST_CASE("pilot: samples that a film drops decide nothing") {
  using Limits = std::numeric_limits<float>;
  const Faulty faulty(0.9f, GENERATE(Limits::infinity(), Limits::quiet_NaN(), -1e6f));
  const Noisy sound(0.3f, 1);
  const std::array<const Integrator*, 2> both{&sound, &faulty};
  const auto results = comparePilots(cameraOf(160, 90), both, {.tiles = 128, .samples = 8, .seed = 3});
  CHECK(results[0].variance == Approx(0.09 / 24 / 1.25).epsilon(0.1));
  CHECK(results[1].variance == Approx(0.81 / 24 / 1.25).epsilon(0.1));
}

TEST_CASE("pilot: pixels are spread over the columns of the image") {
  // The right quarter begins where x is half the width from the centre. The camera looks along +z, with x to the left.
  const RayCamera camera = cameraOf(256, 256);
  const Vec3 edge = camera.rayThrough(Vec2(192, 128)).direction;
  const NoisyAtTheRight noisy(edge.x() / edge.z());
  const std::array<const Integrator*, 1> one{&noisy};
  const auto results = comparePilots(camera, one, {.tiles = 128, .samples = 32, .seed = 5});
  // The mean of 32 uniform numbers has variance 1 / 96; the squared mean is 1 + ¼. The worst pixels, 2 % of those with
  // noise, are left out; they have 15 % of the variance, because the means are nearly normal.
  CHECK(results[0].variance == Approx(0.85 * 0.25 / 96 / 1.25).epsilon(0.15));
}

TEST_CASE("pilot: works for images smaller than a tile, and for black ones") {
  const Noisy noisy(0.5f, 1);
  const std::array<const Integrator*, 1> one{&noisy};
  CHECK(comparePilots(cameraOf(1, 3), one, {})[0].variance > 0);
  class Black : public Integrator {
    Rgb radiance(const Ray&, Sampler&, PathStatistics&) const override { return Rgb::Zero(); }
  };
  const Black black;
  const std::array<const Integrator*, 1> dark{&black};
  CHECK(comparePilots(cameraOf(8, 8), dark, {})[0].variance == 0);
}

TEST_CASE("pilot: product is chosen if it is better, with a margin where path has little noise or time is short") {
  const auto comparison = [](double variance, double ratio, bool brief = false) {
    // Inefficiency is variance times cost.
    return compared({variance, 2}, {0.5 * variance, 4 * ratio}, brief);
  };
  CHECK(comparison(1, 0.9).ratio() == Approx(0.9));
  for (const double variance : {0.001, 0.1}) {
    CHECK(comparison(variance, 0.7).prefersProduct());
    CHECK_FALSE(comparison(variance, 0.7).isUndecided());
    CHECK_FALSE(comparison(variance, 1.05).prefersProduct());
    CHECK_FALSE(comparison(variance, 1.5).isUndecided());
  }
  CHECK_FALSE(comparison(0.001, 0.9).prefersProduct());
  CHECK_FALSE(comparison(0.001, 0.9).isUndecided());
  CHECK(comparison(0.1, 0.9).prefersProduct());
  CHECK(comparison(0.1, 0.9).isUndecided());
  CHECK(comparison(0.1, 1.05).isUndecided());
  CHECK(comparison(0.1, 0.7, true).prefersProduct());
  CHECK_FALSE(comparison(0.1, 0.9, true).prefersProduct());
  CHECK_FALSE(comparison(0.1, 0.9, true).isUndecided());
}
