// Splatting of samples on grids, against filter importance sampling and closed forms.

#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include <oneapi/tbb/global_control.h>
#include <catch2/catch.hpp>

#include "runtime/render/film/sample_grid.h"
#include "runtime/render/integrators/renderer.h"
#include "tests/support/moments.h"

namespace lobe {
namespace {

using test::deviation;
using test::kMaxDeviation;
using test::Moments;

constexpr int kWidth = 6, kHeight = 5;

const std::array kFilters{PixelFilter{PixelFilter::Kind::tent, 1.0f},
                          PixelFilter{PixelFilter::Kind::gaussian, 2.0f, 0.5f},
                          PixelFilter{PixelFilter::Kind::mitchell, 2.0f}, PixelFilter{PixelFilter::Kind::lanczos, 3.0f},
                          PixelFilter{PixelFilter::Kind::box, 1.3f}};

RayCamera cameraWith(const PixelFilter& filter, int width = kWidth, int height = kHeight) {
  Camera camera;
  camera.width = width, camera.height = height;
  return {camera, filter};
}

/// Radiance as a function of the direction of the ray, which no scene is needed for.
class Pattern : public Integrator {
 public:
  using Value = std::function<Rgb(const Vec3& direction, Sampler& rng)>;
  explicit Pattern(Value value) : value_(std::move(value)) {}
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const override {
    ++statistics.paths;
    return value_(ray.direction, rng);
  }

 private:
  Value value_;
};

/// Edges and slopes within pixels, also at the border of the image.
Rgb edges(const Vec3& direction, Sampler&) {
  const float u = direction.x() / direction.z(), v = direction.y() / direction.z();
  return {std::sin(31.0f * u) > 0.3f ? 2.0f : 0.5f, 1.5f + std::sin(20.0f * v + 9.0f * u), u > 0.1f * v ? 1.0f : 0.0f};
}

Film renderPattern(const PixelFilter& filter, const Pattern& pattern, const RenderOptions& options) {
  const RayCamera camera = cameraWith(filter);
  Film film(kWidth, kHeight);
  render(camera, pattern, film, options);
  return film;
}

RenderOptions optionsOf(int samples, PixelFiltering filtering, PixelSampling sampling = PixelSampling::sobol) {
  return {1, samples, std::nullopt, sampling, filtering};
}

/// The largest deviation of a pixel of two films, in standard errors of their difference.
double worst(const Film& a, const Film& b) {
  const Image meanA = a.mean(), meanB = b.mean(), varA = a.varianceOfMean(), varB = b.varianceOfMean();
  double result = 0;
  for (std::size_t i = 0; i < meanA.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c)
      result = std::max(result, std::abs(double(meanA.pixels[i][c]) - meanB.pixels[i][c]) /
                                    std::sqrt(double(varA.pixels[i][c]) + varB.pixels[i][c] + 1e-12));
  return result;
}

bool sameFilm(const Film& a, const Film& b) {
  for (std::size_t i = 0; i < a.pixels().size(); ++i)
    if (std::memcmp(&a.pixels()[i], &b.pixels()[i], sizeof(Film::Pixel)) != 0) return false;
  return a.pixels().size() == b.pixels().size();
}

}  // namespace

TEST_CASE("sample grid: splatting and filter importance sampling converge to the same image") {
  for (const PixelFilter& filter : kFilters) {
    const auto film = [&](PixelFiltering filtering, PixelSampling sampling) {
      return renderPattern(filter, Pattern(edges), optionsOf(1 << 14, filtering, sampling));
    };
    INFO("filter " << static_cast<int>(filter.kind));
    const Film expected = film(PixelFiltering::importance, PixelSampling::independent);
    CHECK(worst(expected, film(PixelFiltering::splatting, PixelSampling::independent)) < 4.5);
    CHECK(worst(expected, film(PixelFiltering::splatting, PixelSampling::sobol)) < 4.5);
    // Without the border, or with another filter, the test fails.
    const PixelFilter wider{PixelFilter::Kind::tent, 1.2f * filter.radius};
    CHECK(worst(expected, renderPattern(wider, Pattern(edges), optionsOf(1 << 14, PixelFiltering::splatting))) > 4.5);
  }
}

TEST_CASE("sample grid: constant radiance has no noise with a tent") {
  const Pattern pattern([](const Vec3&, Sampler&) { return Rgb(0.25f, 1.0f, 3.0f); });
  const Film film = renderPattern(kFilters[0], pattern, optionsOf(1, PixelFiltering::splatting));
  for (const Rgb& pixel : film.mean().pixels) CHECK((pixel / Rgb(0.25f, 1.0f, 3.0f) - 1).abs().maxCoeff() < 1e-6f);
}

TEST_CASE("sample grid: the variance of noise is the integral of the squared filter") {
  const Pattern noise([](const Vec3&, Sampler& rng) { return Rgb(Rgb::Constant(rng.uniform())); });
  const std::array<double, 2> expected{4.0 / 9, 0.3205};  // tent of radius 1; Gaussian, by quadrature
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Film film =
        renderPattern(kFilters[i], noise, optionsOf(1 << 13, PixelFiltering::splatting, PixelSampling::independent));
    Moments variance;
    for (const Rgb& pixel : film.varianceOfMean().pixels) variance.add(pixel.x());
    CHECK(variance.mean() * (1 << 13) == Approx(expected[i] / 12).epsilon(0.03));
  }
}

TEST_CASE("sample grid: a box of one pixel has no border, and both ways have the same bytes") {
  CHECK(SampleGrid::border(FilterSampler({})) == 0);
  CHECK(SampleGrid::border(FilterSampler(kFilters[0])) == 1);
  CHECK(SampleGrid::border(FilterSampler(kFilters[1])) == 2);
  CHECK(SampleGrid::border(FilterSampler(kFilters[3])) == 3);
  CHECK(SampleGrid::border(FilterSampler(kFilters[4])) == 1);
  CHECK(sameFilm(renderPattern({}, Pattern(edges), optionsOf(5, PixelFiltering::splatting)),
                 renderPattern({}, Pattern(edges), optionsOf(5, PixelFiltering::importance))));
}

TEST_CASE("sample grid: the image depends neither on threads nor on where it is stopped and continued") {
  const PixelFilter& filter = kFilters[1];
  const auto value = [](const Vec3& d, Sampler& rng) { return Rgb(rng.uniform(), rng.stratified(), d.x() + 1); };
  const Pattern noise(value);
  const auto film = [&](int threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    return renderPattern(filter, noise, optionsOf(40, PixelFiltering::splatting));
  };
  const Film whole = film(1);
  CHECK(sameFilm(whole, film(2)));
  CHECK(sameFilm(whole, film(7)));

  constexpr int kPoints = (kWidth + 4) * (kHeight + 4);
  for (const int moment : {1, kPoints + 1, 7 * kPoints + 5, 39 * kPoints}) {
    StopFlag stop = 0;
    std::atomic<int> left = moment;
    const Pattern stopping([&](const Vec3& d, Sampler& rng) {
      if (--left == 0) stop = 1;
      return value(d, rng);
    });
    const RayCamera camera = cameraWith(filter);
    RenderOptions options = optionsOf(40, PixelFiltering::splatting);
    options.stop = &stop;
    Film part(kWidth, kHeight);
    const RenderResult before = render(camera, stopping, part, options);
    CHECK(before.stopped == (part.sampleRange().first < 40));
    CHECK(part.sampleRange().first == part.sampleRange().second);
    CHECK(part.sampleRange().first >= 1);
    stop = 0;
    const RenderResult result = render(camera, noise, part, options, {}, before);
    CHECK(result.statistics.paths == 40u * kPoints);
    CHECK(sameFilm(part, whole));
  }
}

TEST_CASE("sample grid: parts of the samples add up to the whole") {
  const auto mean = [&](int first, int count) {
    RenderOptions options = optionsOf(count, PixelFiltering::splatting);
    options.firstSample = first;
    return renderPattern(kFilters[0], Pattern(edges), options).mean();
  };
  const Image whole = mean(0, 12), a = mean(0, 4), b = mean(4, 8);
  for (std::size_t i = 0; i < whole.pixels.size(); ++i)
    CHECK((whole.pixels[i] - (4 * a.pixels[i] + 8 * b.pixels[i]) / 12).abs().maxCoeff() < 1e-6f);
}

TEST_CASE("sample grid: samples that are not finite are dropped and do not reach other pixels") {
  const float bad = GENERATE(std::numeric_limits<float>::quiet_NaN(), kInfinity, -1.0f);
  const FilterSampler tent(kFilters[0]);
  SampleGrid points(4, 3, tent);
  for (int y = -1; y <= 3; ++y)
    for (int x = -1; x <= 4; ++x) points.at(x, y) = Rgb::Ones();
  points.at(1, 1) = Rgb(1, bad, 1);
  points.at(-1, 2) = Rgb(bad, 1, 1);
  points.convolve({0.25f, 0.0f});
  Film film(4, 3);
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x) film.add(x, y, points.filtered(x, y));
  CHECK(film.dropped() == 1);
  CHECK(film.pixel(1, 1).dropped == 1);
  // The weights of a row are 0.25 for the point of the pixel on the left and 0.75 for the pixel's own.
  CHECK(film.mean().at(2, 1).y() == Approx(0.75));
  CHECK(film.mean().at(0, 1).y() == Approx(1));
  CHECK(film.mean().at(0, 2).x() == Approx(0.75));
}

}  // namespace lobe
