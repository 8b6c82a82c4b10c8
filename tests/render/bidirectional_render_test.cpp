// Renders by bidirectional integrators: independence of threads, light paths of the border around the image, and
// renders that are stopped and continued.

#include <algorithm>
#include <atomic>
#include <cstring>
#include <utility>
#include <vector>

#include <oneapi/tbb/global_control.h>
#include <catch2/catch.hpp>

#include "tests/support/bidirectional_test_tools.h"

using namespace lobe;
using namespace lobe::test;

TEST_CASE("bidirectional: the image depends on the seed but not on threads or waves") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto image = [&](int threads, std::uint64_t seed, int first, int samples) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    Film film(stage.camera.width(), stage.camera.height());
    RenderOptions options;
    options.seed = seed, options.samples = samples, options.firstSample = first;
    BdptIntegrator bdpt = stage.bdpt();
    render(stage.camera, bdpt, film, options);
    return film.mean();
  };
  const auto equal = [](const Image& a, const Image& b) {
    return std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Rgb)) == 0;
  };
  const Image one = image(1, 5, 0, 8);
  CHECK(equal(one, image(2, 5, 0, 8)));
  CHECK(equal(one, image(7, 5, 0, 8)));
  CHECK_FALSE(equal(one, image(1, 6, 0, 8)));
  // The parts of an image are those of the whole.
  const Image first = image(2, 5, 0, 4), second = image(2, 5, 4, 4);
  for (std::size_t i = 0; i < one.pixels.size(); ++i)
    CHECK((0.5f * (first.pixels[i] + second.pixels[i]) - one.pixels[i]).abs().maxCoeff() < 1e-5f);
}

TEST_CASE("bidirectional: light paths of the border around the image make no contributions of their own") {
  Stage stage(sceneWith(std::string(kFloor) + kLamp));
  const auto traced = [&](const BidirectionalIntegrator& integrator, std::vector<Splat>* splats) {
    PathStatistics statistics;
    Rgb sum = Rgb::Zero();
    for (int i = 0; i < 300; ++i) {
      Sampler rng(1, 0, i), lightRng(1, 1, i);
      const Ray ray = stage.camera.sample(i % 20, i / 20, rng);
      sum += integrator.radiance(ray, rng, lightRng, statistics, splats);
    }
    return std::pair(sum, statistics.rays());
  };
  const auto check = [&](const BidirectionalIntegrator& integrator) {
    std::vector<Splat> splats;
    const auto [inImage, rays] = traced(integrator, &splats);
    CHECK_FALSE(splats.empty());
    const auto [inBorder, fewer] = traced(integrator, nullptr);
    CHECK((inImage == inBorder).all());
    CHECK(fewer < rays);
  };
  check(stage.bdpt());
  check(stage.pathWithLight());
}

TEST_CASE("bidirectional: the light image has one light path for each pixel, and none of the border") {
  class Counting : public BidirectionalIntegrator {
   public:
    Rgb radiance(const Ray&, Sampler&, Sampler&, PathStatistics&, std::vector<Splat>* splats) const override {
      ++(splats ? inImage : inBorder);
      return Rgb::Zero();
    }
    mutable std::atomic<int> inImage = 0, inBorder = 0;
  };
  Camera camera;
  camera.width = 40, camera.height = 30;
  Film film(40, 30);
  RenderOptions options;
  options.samples = 1;
  Counting integrator;
  render(RayCamera(camera, PixelFilter{PixelFilter::Kind::tent, 1.0f}), integrator, film, options);
  CHECK(integrator.inImage.load() == 40 * 30);
  CHECK(integrator.inBorder.load() == 42 * 32 - 40 * 30);
}

namespace {

/// Sets the flag after a number of camera paths, like a signal at a random moment.
template <class Inner>
class Stopping : public Inner {
 public:
  Stopping(const Inner& inner, int paths, StopFlag& flag) : Inner(inner), left_(paths), flag_(flag) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override {
    if (--left_ == 0) flag_ = 1;
    return Inner::radiance(ray, rng, lightRng, statistics, splats);
  }

 private:
  mutable std::atomic<int> left_;
  StopFlag& flag_;
};

template <class AnyIntegrator>
void checkStopping(const Stage& stage, AnyIntegrator integrator) {
  // With one thread, all tiles of a sample have begun when the flag is set in its last paths, but not in its first.
  const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, 1);
  RenderOptions options;
  options.samples = 9, options.firstSample = 3;
  Film whole(stage.camera.width(), stage.camera.height());
  const RenderResult uninterrupted = render(stage.camera, integrator, whole, options);
  const int pixels = stage.camera.width() * stage.camera.height();
  for (const auto& [moment, complete] : {std::pair(1, 0u), std::pair(pixels, 1u), std::pair(2 * pixels + 1, 2u),
                                         std::pair(5 * pixels - 7, 5u), std::pair(9 * pixels - 1, 9u)}) {
    StopFlag stop = 0;
    options.stop = &stop;
    Film film(stage.camera.width(), stage.camera.height());
    Stopping<AnyIntegrator> stopping(integrator, moment, stop);
    const RenderResult part = render(stage.camera, stopping, film, options);
    CHECK(film.sampleRange() == std::pair(complete, complete));
    CHECK(part.total.samples == static_cast<int>(complete));
    stop = 0;
    const RenderResult result = render(stage.camera, integrator, film, options, {}, part);
    CHECK_FALSE(result.stopped);
    CHECK(result.total.samples == 9);
    CHECK(result.statistics.paths == uninterrupted.statistics.paths);
    CHECK(result.statistics.rays() == uninterrupted.statistics.rays());
    CHECK(std::ranges::equal(film.pixels(), whole.pixels(), [](const Film::Pixel& p, const Film::Pixel& q) {
      return std::memcmp(&p, &q, sizeof p) == 0;
    }));
  }
}

}  // namespace

TEST_CASE("bidirectional: stopped at any moment and continued, an image has the same bytes") {
  const Stage stage(sceneWith(std::string(kFloor) + kLamp));
  checkStopping(stage, stage.bdpt());
  checkStopping(stage, stage.pathWithLight());
  // The radius shrinks with the index of the sample.
  checkStopping(stage, VcmIntegrator(stage.ready, stage.camera, stage.options, {0.3f, 0.5f}));
}
