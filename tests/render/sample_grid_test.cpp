// Splatting of samples on grids, against filter importance sampling and closed forms.

#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
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

constexpr int kWidth = 37, kHeight = 20;  // several tiles

const std::array kFilters{
    PixelFilter{PixelFilter::Kind::tent, 1.0f},     PixelFilter{PixelFilter::Kind::gaussian, 2.0f, 0.5f},
    PixelFilter{PixelFilter::Kind::mitchell, 2.0f}, PixelFilter{PixelFilter::Kind::lanczos, 3.0f},
    PixelFilter{PixelFilter::Kind::box, 1.3f},      PixelFilter{PixelFilter::Kind::tent, 0.7f}};

/// A part of a wider film, so that its borders are inside the film or outside.
RayCamera cameraWith(const PixelFilter& filter, int width = kWidth, int height = kHeight) {
  Camera camera;
  camera.width = width + 9, camera.height = height;
  camera.crop = FilmCrop{9, 0, width, height};
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

/// Edges and slopes within pixels, also at the border of the image. With a little noise, because the variance of a
/// pixel in which hardly any sample sees an edge cannot be estimated.
Rgb edges(const Vec3& direction, Sampler& rng) {
  const float u = direction.x() / direction.z(), v = direction.y() / direction.z();
  const Rgb value(std::sin(131.0f * u) > 0.3f ? 2.0f : 0.5f, 1.5f + std::sin(90.0f * v + 50.0f * u),
                  u > 0.1f * v ? 1.0f : 0.2f);
  return value * (0.8f + 0.4f * rng.uniform());
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
  constexpr int kSamples = 1 << 11;
  for (const PixelFilter& filter : kFilters) {
    const auto film = [&](PixelFiltering filtering, PixelSampling sampling) {
      return renderPattern(filter, Pattern(edges), optionsOf(kSamples, filtering, sampling));
    };
    INFO("filter " << static_cast<int>(filter.kind));
    const Film expected = film(PixelFiltering::importance, PixelSampling::independent);
    CHECK(worst(expected, film(PixelFiltering::splatting, PixelSampling::independent)) < 5);
    CHECK(worst(expected, film(PixelFiltering::splatting, PixelSampling::sobol)) < 5);
    // 2220 values; a slightly wider filter fails the test.
    const PixelFilter wider{PixelFilter::Kind::tent, 1.2f * filter.radius};
    CHECK(worst(expected, renderPattern(wider, Pattern(edges), optionsOf(kSamples, PixelFiltering::splatting))) > 8);
  }
}

TEST_CASE("sample grid: constant radiance has no noise") {
  const Pattern pattern([](const Vec3&, Sampler&) { return Rgb(0.25f, 1.0f, 3.0f); });
  for (const PixelFilter& filter : kFilters) {
    const Film film = renderPattern(filter, pattern, optionsOf(1, PixelFiltering::splatting));
    for (const Rgb& pixel : film.mean().pixels) CHECK((pixel / Rgb(0.25f, 1.0f, 3.0f) - 1).abs().maxCoeff() < 1e-6f);
  }
}

TEST_CASE("sample grid: the variance of noise") {
  const Pattern noise([](const Vec3&, Sampler& rng) { return Rgb(Rgb::Constant(rng.uniform())); });
  constexpr int kSamples = 1 << 10;
  for (const PixelFilter& filter : kFilters) {
    const Film film =
        renderPattern(filter, noise, optionsOf(kSamples, PixelFiltering::splatting, PixelSampling::independent));
    Moments variance;
    for (const Rgb& pixel : film.varianceOfMean().pixels) variance.add(pixel.x());
    const double relative = GridFilter::relativeVariance(FilterSampler(filter));
    CHECK(12 * kSamples * variance.mean() == Approx(relative).epsilon(0.02));
    CHECK(relative <= 1);
  }
  CHECK(GridFilter::relativeVariance(FilterSampler(kFilters[0])) == Approx(4.0 / 9).epsilon(0.01));
  CHECK(GridFilter::relativeVariance(FilterSampler(kFilters[1])) == Approx(0.319).epsilon(0.01));  // ∫f² nearly
  CHECK(GridFilter::relativeVariance(FilterSampler({})) == Approx(1));
}

TEST_CASE("sample grid: a box of one pixel has no border, and both ways have the same bytes") {
  CHECK(GridFilter::border(FilterSampler({})) == 0);
  CHECK(GridFilter::border(FilterSampler(kFilters[0])) == 1);
  CHECK(GridFilter::border(FilterSampler(kFilters[1])) == 2);
  CHECK(GridFilter::border(FilterSampler(kFilters[3])) == 3);
  CHECK(GridFilter::border(FilterSampler(kFilters[4])) == 1);
  CHECK(GridFilter::border(FilterSampler({PixelFilter::Kind::gaussian, 4e9f, 1e9f})) == 0);
  CHECK(sameFilm(renderPattern({}, Pattern(edges), optionsOf(5, PixelFiltering::splatting)),
                 renderPattern({}, Pattern(edges), optionsOf(5, PixelFiltering::importance))));
}

TEST_CASE("sample grid: a very small image has no border, which would take more time than it saves") {
  const auto paths = [](int size) {
    Film film(size, size);
    const RayCamera camera = cameraWith(kFilters[1], size, size);
    return render(camera, Pattern(edges), film, optionsOf(3, PixelFiltering::splatting)).statistics.paths;
  };
  CHECK(paths(1) == 3);
  CHECK(paths(5) == 3 * 5 * 5);
  CHECK(paths(6) == 3 * 10 * 10);
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
  int uneven = 0;
  for (const int moment : {1, kPoints / 2, kPoints + 1, 7 * kPoints + 5, 20 * kPoints, 39 * kPoints + 9}) {
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
    const auto [least, most] = part.sampleRange();
    uneven += least < most;
    CHECK(before.total.samples == static_cast<int>(least));
    CHECK(before.statistics.paths == least * kPoints);
    stop = 0;
    const RenderResult result = render(camera, noise, part, options, {}, before);
    CHECK_FALSE(result.stopped);
    CHECK(result.statistics.paths == 40u * kPoints);
    CHECK(sameFilm(part, whole));
  }
  CHECK(uneven > 2);
}

TEST_CASE("sample grid: if rendering fails, the result is that of the samples of the film") {
  constexpr int kPoints = (kWidth + 4) * (kHeight + 4);
  std::atomic<int> calls = 0;
  // After half of the last wave, which has two parts.
  const Pattern failing([&](const Vec3&, Sampler&) {
    if (++calls > 48 * kPoints) throw std::runtime_error("no memory");
    return Rgb(1, 1, 1);
  });
  RenderOptions options = optionsOf(64, PixelFiltering::splatting);
  std::optional<RenderResult> last, failed;
  options.onFailure = [&](const RenderResult& result) { failed = result; };
  const auto afterWave = [&](const RenderResult& result) { last = result; };
  const RayCamera camera = cameraWith(kFilters[1]);
  Film film(kWidth, kHeight);
  CHECK_THROWS_WITH(render(camera, failing, film, options, afterWave), "no memory");
  const auto [least, most] = film.sampleRange();
  REQUIRE((least == most && last && failed));
  CHECK(failed->total.samples == static_cast<int>(least));
  CHECK(failed->statistics.paths == least * kPoints);
  CHECK(failed->total.samples >= last->total.samples);
  CHECK(failed->total.seconds > last->total.seconds);
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
  SampleGrid points(4, 3, 1);
  for (int y = -1; y <= 3; ++y)
    for (int x = -1; x <= 4; ++x) points.at(x, y) = Rgb::Ones();
  points.at(1, 1) = Rgb(1, bad, 1);
  points.at(-1, 2) = Rgb(bad, 1, 1);
  GridFilter filter(4, 3, tent);
  filter.apply(points, {0.25f, 0.0f});
  Film film(4, 3);
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x) film.add(x, y, filter.at(x, y));
  CHECK(film.dropped() == 1);
  CHECK(film.pixel(1, 1).dropped == 1);
  // The weights of a row are 0.25 for the point of the pixel on the left and 0.75 for the pixel's own.
  CHECK(film.mean().at(2, 1).y() == Approx(0.75));
  CHECK(film.mean().at(0, 1).y() == Approx(1));
  CHECK(film.mean().at(0, 2).x() == Approx(0.75));
}

}  // namespace lobe
