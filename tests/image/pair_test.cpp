// The relative variance of a method from two of its pictures, and its confidence intervals.

#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/core/random.h"
#include "runtime/image/error_map.h"
#include "runtime/image/image_output.h"
#include "runtime/image/pair_variance.h"
#include "tests/support/json.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr float kMean = 1, kDeviation = 0.02f;

float normal(Rng& rng) {
  const double radius = std::sqrt(-2 * std::log(1 - rng.uniformDouble()));
  return static_cast<float>(radius * std::cos(2 * std::numbers::pi * rng.uniformDouble()));
}

/// Grey pixels with normal noise, the same in tiles of this size, which start at (−3, −2).
Image noisy(int size, int tile, Rng& rng) {
  const int tiles = (size + 2) / tile + 1;
  std::vector<float> values(static_cast<std::size_t>(tiles) * tiles);
  for (float& v : values) v = kMean + kDeviation * normal(rng);
  Image image(size, size);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) image.at(x, y) = grey(values[(y + 2) / tile * tiles + (x + 3) / tile]);
  return image;
}

/// What fraction of the intervals contains the expected value, and the means of the estimates over that value.
struct Coverage {
  double all = 0, drop01 = 0, drop1 = 0, meanOfAll = 0, meanOfDrop1 = 0;
};

bool contains(const MeanEstimate& e, double value) {
  return e.interval.low <= value && value <= e.interval.high;
}

/// The mean of z² over the part of the standard normal distribution with |z| < limit, of the probability `kept`.
double trimmedSquare(double limit, double kept) {
  return 1 - 2 * limit * std::exp(-0.5 * limit * limit) / std::sqrt(2 * std::numbers::pi) / kept;
}

Coverage coverage(int tile) {
  constexpr int kTrials = 400, kSize = 160;
  const double truth = kDeviation * kDeviation / (kMean * kMean + 0.01);
  // The quantiles of |z| at 0.999 and 0.99.
  const double truth01 = truth * trimmedSquare(3.290527, 0.999), truth1 = truth * trimmedSquare(2.575829, 0.99);
  Coverage result;
  for (int trial = 0; trial < kTrials; ++trial) {
    Rng rng(7, static_cast<std::uint64_t>(tile), static_cast<std::uint64_t>(trial));
    const Image a = noisy(kSize, tile, rng), b = noisy(kSize, tile, rng);
    const PairVariance v = comparePair(a, b);
    result.all += contains(v.all, truth) / double{kTrials};
    result.drop01 += contains(v.drop01, truth01) / double{kTrials};
    result.drop1 += contains(v.drop1, truth1) / double{kTrials};
    result.meanOfAll += v.all.value / truth / kTrials;
    result.meanOfDrop1 += v.drop1.value / truth1 / kTrials;
  }
  return result;
}

ToolRun lobecompare(const std::string& arguments) {
  return runBinary(".", "lobecompare " + arguments);
}

}  // namespace

TEST_CASE("pair: the intervals contain the true variance in about 95 % of the trials") {
  // 400 trials: one standard deviation of the fraction is 1.1 %. Percentiles of 100 blocks are slightly too narrow.
  const int tile = GENERATE(1, 5);
  const Coverage c = coverage(tile);
  CAPTURE(tile, c.all, c.drop01, c.drop1);
  CHECK(c.meanOfAll == Approx(1).margin(0.01));
  CHECK(c.meanOfDrop1 == Approx(1).margin(0.01));
  for (const double fraction : {c.all, c.drop01, c.drop1}) {
    CHECK(fraction > 0.91);
    CHECK(fraction < 0.98);
  }
}

TEST_CASE("pair: relative variances of simple images") {
  Image a(40, 40, grey(0.5f)), b(40, 40, grey(0.7f));
  const double each = 0.5 * 0.04 / (0.36 + 0.01);
  SECTION("a constant difference") {
    const PairVariance v = comparePair(a, b);
    CHECK(v.all.value == Approx(each));
    CHECK(v.drop1.value == Approx(each));
    CHECK(v.all.interval.low == Approx(each));
    CHECK(v.all.interval.high == Approx(each));
    CHECK(v.meanRatio == Approx(1.4));
    CHECK(comparePair(b, a).all.value == v.all.value);
  }
  SECTION("one outlier, which counts 2 at most") {
    Image c = a;
    c.at(30, 20) = grey(1e6f);
    const PairVariance v = comparePair(a, c);
    CHECK(v.all.value == Approx(2.0 / 1600).epsilon(1e-4));
    CHECK(v.drop01.value == 0);  // the worst of 1600 pixels is one of 0.1 %
    CHECK((v.all.interval.low == 0 && v.all.interval.high > v.all.value));
  }
  SECTION("pixels that are not finite") {
    b.at(3, 3).y() = std::numeric_limits<float>::quiet_NaN();
    b.at(4, 3).x() = std::numeric_limits<float>::infinity();
    const PairVariance v = comparePair(a, b);
    CHECK(v.nonfinite == 2);
    CHECK(v.all.value == Approx(each));
    CHECK(v.meanRatio == Approx(1.4));
    CHECK(std::isnan(relativeVariances(a, b)[3 * 40 + 3]));
  }
  SECTION("one block has no interval") {
    const PairVariance v = comparePair(Image(16, 16, grey(1)), Image(16, 16, grey(2)));
    CHECK(v.all.value > 0);
    CHECK(std::isnan(v.all.interval.low));
  }
  SECTION("sizes") {
    CHECK_THROWS_WITH(comparePair(a, Image(40, 39)), "the image has 40x39 pixels, the other 40x40");
    CHECK_THROWS(comparePair(Image(), Image()));
  }
}

TEST_CASE("pair: resampling is deterministic and keeps trimmed means in order") {
  Rng rng(3);
  const Image a = noisy(100, 1, rng), b = noisy(100, 1, rng);
  const PairVariance v = comparePair(a, b), again = comparePair(a, b);
  CHECK((v.all.interval.low == again.all.interval.low && v.drop1.interval.high == again.drop1.interval.high));
  CHECK((v.drop1.value < v.drop01.value && v.drop01.value < v.all.value));
  for (const MeanEstimate& e : {v.all, v.drop01, v.drop1})
    CHECK((e.interval.low < e.value && e.value < e.interval.high));
}

TEST_CASE("pair: lobecompare --pair prints text and JSON and a map") {
  const Folder folder;
  const std::string a = folder / "a.exr", b = folder / "b.exr", map = folder / "map.png";
  Rng rng(1);
  const auto attributes = [](double seed) {
    return ImageAttributes{{"integrator", "path"}, {"seed", seed}, {"samples", 4.0}};
  };
  writeImage(a, noisy(64, 1, rng), attributes(1));
  writeImage(b, noisy(64, 1, rng), attributes(2));
  SECTION("results") {
    const ToolRun run = lobecompare("--pair --json " + a + " " + b + " --map " + map);
    REQUIRE(run.code == 0);
    const auto json = parseJson(run.out);
    const PairVariance v = comparePair(readImage(a), readImage(b));
    CHECK(json["images"] == nlohmann::json::array({a, b}));
    CHECK(json["relvar"].get<double>() == v.all.value);
    CHECK(json["relvar_drop_1pct_interval"][1].get<double>() == v.drop1.interval.high);
    CHECK(json["relvar_drop_0.1pct"].get<double>() == v.drop01.value);
    CHECK(json["nonfinite"] == 0);
    CHECK(readImage(map).width == 64);
    const ToolRun text = lobecompare("--pair " + a + " " + b);
    CHECK((text.code == 0 && text.error.empty() && lineCount(text.out) == 2));
    CHECK_THAT(text.out, Catch::Contains("relative variance [95 %]"));
  }
  SECTION("faults") {
    writeImage(folder / "small.exr", Image(63, 64), attributes(3));
    const std::string small = folder / "small.exr";
    CHECK(lobecompare("--pair " + a + " " + small).error ==
          "lobecompare: error: " + small + ": the image has 63x64 pixels, the other 64x64\n");
    writeImage(folder / "same.exr", Image(64, 64), attributes(1));
    const ToolRun same = lobecompare("--pair " + a + " " + (folder / "same.exr").string());
    CHECK(same.code == 1);
    CHECK_THAT(same.error, Catch::Contains("both have samples of seed 1; render one with another --seed"));
    CHECK(lobecompare("--pair " + a + " " + b + " " + b).code == 2);
    CHECK(lobecompare("--pair " + a + " " + b + " --shrink 2").code == 2);
    CHECK(lobecompare("--pair " + a + " " + b + " --merge c.exr").code == 2);
    CHECK(lobecompare("--pair " + a + " " + (folder / "none.exr").string()).code == 1);
  }
}
