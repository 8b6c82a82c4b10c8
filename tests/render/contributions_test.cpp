// The largest contributions, and the limit of indirect light (--firefly-limit).

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <oneapi/tbb/global_control.h>
#include <catch2/catch.hpp>

#include "runtime/core/random.h"
#include "runtime/render/gradients/gradient_integrator.h"
#include "tests/support/batches.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

// A lamp behind glass over a floor and a mirror: direct and indirect light, and caustics.
Scene causticScene() {
  return readText(R"(<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="50"/>
      <transform name="to_world"><lookat origin="0, -6, 2.5" target="0, 0, 0.9" up="0, 0, 1"/></transform>
      <film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="15"/>
      <rfilter type="box"/></film></sensor>
    <bsdf type="twosided" id="grey"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
    <shape type="rectangle"><transform name="to_world"><scale value="3"/></transform><ref id="grey"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="90"/>
      <translate y="2.5"/></transform><ref id="grey"/></shape>
    <shape type="sphere"><point name="center" x="0.8" y="-0.3" z="1"/><float name="radius" value="0.6"/>
      <bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="1" y="-0.5" z="3.2"/><float name="radius" value="0.2"/>
      <emitter type="area"><rgb name="radiance" value="40, 30, 20"/></emitter></shape></scene>)");
}

struct Rendered {
  double sum = 0;  // of the luminances of all samples
  PathStatistics statistics;
};

template <class AnyIntegrator>
Rendered rendered(const Stage& stage, AnyIntegrator integrator, int samples = 16) {
  Film film(stage.camera.width(), stage.camera.height());
  RenderOptions options;
  options.samples = samples;
  Rendered result;
  result.statistics = render(stage.camera, integrator, film, options).statistics;
  for (const Film::Pixel& pixel : film.pixels())
    result.sum += luminance(Eigen::Map<const Eigen::Array3d>(pixel.sum).cast<float>());
  return result;
}

std::vector<LargestContributions::Key> sorted(const LargestContributions& largest) {
  std::vector<LargestContributions::Key> keys(largest.keys.begin(), largest.keys.end());
  std::ranges::sort(keys, std::greater<>());
  return keys;
}

/// Checks that what the limit cuts off is what the picture lacks.
template <class MakeIntegrator>
void checkLimit(Stage& stage, const MakeIntegrator& make) {
  const Rendered whole = rendered(stage, make());
  CHECK(whole.statistics.cut.units == 0);
  const float limit = 0.1f;
  stage.options.fireflyLimit = limit;
  const Rendered limited = rendered(stage, make());
  const double cut = limited.statistics.cut.times(limit);
  CHECK(cut > 0.005 * whole.sum);
  CHECK(limited.sum + cut == Approx(whole.sum).epsilon(1e-4));
  // The kinds are those of the paths, not of what is left of them.
  CHECK(sorted(limited.statistics.largest) == sorted(whole.statistics.largest));
  // Direct light is not limited.
  stage.options.fireflyLimit = kInfinity, stage.options.maxDepth = 2;
  const double direct = rendered(stage, make()).sum;
  stage.options.fireflyLimit = 1e-3f;
  const Rendered kept = rendered(stage, make());
  CHECK(kept.sum == direct);
  CHECK(kept.statistics.cut.units == 0);
}

/// Contributions of single samples, sorted by kind.
using ByKind = std::vector<std::pair<std::uint32_t, float>>;

ByKind byKind(const LargestContributions& largest) {
  ByKind result;
  for (const LargestContributions::Key key : largest.keys)
    if (key != 0) result.emplace_back(static_cast<std::uint32_t>(key), LargestContributions::luminanceOf(key));
  std::ranges::sort(result);
  return result;
}

bool agree(const ByKind& a, const ByKind& b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) {
    return x.first == y.first && std::abs(x.second - y.second) <= 1e-3f * y.second;
  });
}

/// Checks that samples of gradients have the contributions of other samples. Both: from column, row and index to the
/// statistics.
template <class OfGradients, class OfOther>
void checkSameContributions(const Stage& stage, const OfGradients& ofGradients, const OfOther& ofOther) {
  int samples = 0, different = 0, found = 0;
  for (int y = 0; y < stage.camera.height(); ++y)
    for (int x = 0; x < stage.camera.width(); ++x)
      for (int s = 0; s < 16; ++s) {
        const ByKind gradients = byKind(ofGradients(x, y, s).largest), other = byKind(ofOther(x, y, s).largest);
        ++samples;
        different += !agree(gradients, other);
        found += !other.empty();
      }
  CHECK(found > samples / 2);
  CHECK(different <= 0.001 * samples);  // rounding
}

}  // namespace

TEST_CASE("contributions: the largest are kept in any order") {
  Rng rng(3);
  std::vector<std::pair<float, PathKind>> all;
  for (int i = 0; i < 1000; ++i)
    all.push_back({rng.uniform() * 100, {static_cast<Technique>(i % 5), i % 70000, i % 2 == 1}});
  LargestContributions forward, backward, first, second;
  for (const auto& [value, kind] : all) forward.add(value, kind);
  for (std::size_t i = all.size(); i-- > 0;) backward.add(all[i].first, all[i].second);
  for (std::size_t i = 0; i < all.size(); ++i) (i % 3 == 0 ? first : second).add(all[i].first, all[i].second);
  first.add(second);
  CHECK(sorted(forward) == sorted(backward));
  CHECK(sorted(forward) == sorted(first));
  std::ranges::sort(all, [](const auto& a, const auto& b) { return a.first > b.first; });
  const auto keys = sorted(forward);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    CHECK(LargestContributions::luminanceOf(keys[i]) == all[i].first);
    const PathKind kind = LargestContributions::kindOf(keys[i]);
    CHECK(kind.technique == all[i].second.technique);
    CHECK(kind.segments == all[i].second.segments);
    CHECK(kind.deltaAtLight == all[i].second.deltaAtLight);
  }
  forward.add(kInfinity, all[0].second);
  forward.add(NAN, all[0].second);
  CHECK(sorted(forward) == keys);
}

TEST_CASE("contributions: the limit scales indirect light only, and says what it cuts off") {
  FoundLight found;
  found.add(Rgb(5, 5, 5), 2);
  found.add(Rgb(1, 2, 3), 3);
  found.add(Rgb(1, 0, 1), 7);
  CutLight cut;
  CHECK((found.limited(kInfinity, cut) == found.total()).all());
  CHECK(cut.units == 0);
  const Rgb indirect(2, 2, 4);
  const Rgb limited = found.limited(0.5f, cut);
  CHECK((limited - Rgb(5, 5, 5) - indirect * (0.5f / luminance(indirect))).abs().maxCoeff() < 1e-5f);
  CHECK(cut.times(0.5) == Approx(luminance(indirect) - 0.5).epsilon(1e-4));
}

TEST_CASE("contributions: what the limit cuts off is what the picture lacks, with any integrator") {
  Stage stage(causticScene());
  SECTION("path") {
    checkLimit(stage, [&] { return stage.path(); });
  }
  SECTION("path with light paths") {
    checkLimit(stage, [&] { return stage.pathWithLight(); });
  }
  SECTION("bdpt") {
    checkLimit(stage, [&] { return stage.bdpt(); });
  }
  SECTION("vcm") {
    checkLimit(stage, [&] { return stage.vcm(0.05f); });
  }
}

TEST_CASE("contributions: the largest say what kind of path they come from") {
  const Stage stage(causticScene());
  const auto anyOf = [](const std::vector<LargestContributions::Key>& keys, Technique technique) {
    return std::ranges::any_of(keys, [&](LargestContributions::Key key) {
      const PathKind kind = LargestContributions::kindOf(key);
      return kind.technique == technique && kind.segments >= 4 && kind.deltaAtLight;
    });
  };
  // Path tracing finds the caustic by chance, through two refractions; light tracing finds it, too.
  const auto ofPath = sorted(rendered(stage, stage.path(), 64).statistics.largest);
  const auto ofLight = sorted(rendered(stage, stage.pathWithLight(), 64).statistics.largest);
  CHECK(anyOf(ofPath, Technique::emission));
  CHECK_FALSE(anyOf(ofPath, Technique::lightTracing));
  CHECK(anyOf(ofLight, Technique::lightTracing));
}

TEST_CASE("contributions: gradients have those of the same paths without gradients") {
  const Stage stage(causticScene());
  const auto pixelOf = [&](int x, int y) { return static_cast<std::uint64_t>(y) * stage.camera.width() + x; };
  const auto sampler = [&](int x, int y, int s) {
    return Sampler::stratified(1, pixelOf(x, y), static_cast<std::uint32_t>(s));
  };
  const auto lightSampler = [&](int x, int y, int s) {
    return Sampler(2, pixelOf(x, y), static_cast<std::uint64_t>(s));
  };
  SECTION("path") {
    const PathIntegrator path = stage.path();
    const PathGradients gradients(stage.ready, stage.camera, stage.options);
    const auto ofGradients = [&](int x, int y, int s) {
      PathStatistics statistics;
      Sampler rng = sampler(x, y, s);
      gradients.sample(x, y, rng, statistics);
      return statistics;
    };
    checkSameContributions(stage, ofGradients, [&](int x, int y, int s) {
      PathStatistics statistics;
      Sampler rng = sampler(x, y, s);
      const Ray ray = stage.camera.rayThrough(x, y, stage.camera.sample(rng));
      path.radiance(ray, rng, statistics);
      return statistics;
    });
  }
  SECTION("bdpt") {
    const BdptIntegrator bdpt = stage.bdpt();
    const BdptGradients gradients(stage.ready, stage.camera, stage.options);
    const auto ofGradients = [&](int x, int y, int s) {
      PathStatistics statistics;
      Sampler rng = sampler(x, y, s), lightRng = lightSampler(x, y, s);
      GradientSplatLists lists;
      for (auto& list : lists) list.assign(1, {});
      gradients.sample(x, y, rng, lightRng, statistics, GradientSplats(lists, 0));
      return statistics;
    };
    checkSameContributions(stage, ofGradients, [&](int x, int y, int s) {
      PathStatistics statistics;
      Sampler rng = sampler(x, y, s), lightRng = lightSampler(x, y, s);
      std::vector<Splat> splats;
      const Ray ray = stage.camera.rayThrough(x, y, stage.camera.sample(rng));
      bdpt.radiance(ray, rng, lightRng, statistics, &splats);
      return statistics;
    });
  }
}

TEST_CASE("contributions: largest and cut do not depend on threads") {
  Stage stage(causticScene());
  stage.options.fireflyLimit = 0.1f;
  const auto with = [&](std::size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    return rendered(stage, stage.pathWithLight()).statistics;
  };
  const PathStatistics one = with(1), two = with(2), seven = with(7);
  CHECK(sorted(one.largest) == sorted(two.largest));
  CHECK(sorted(one.largest) == sorted(seven.largest));
  CHECK(one.cut.units == two.cut.units);
  CHECK(one.cut.units == seven.cut.units);
}
