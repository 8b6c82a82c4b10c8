// The test of whether two methods have the same expected picture, and the variance of merged pictures.

#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "runtime/core/random.h"
#include "runtime/image/agreement.h"
#include "runtime/image/image_output.h"
#include "runtime/image/merge.h"
#include "tests/support/json.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;

namespace {

/// Pixels of mean 1 and of standard deviation 0.2 / √samples, the noise of neighbours in a row being equal.
Image noisy(double samples, Rng& rng) {
  Image image(48, 40);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; x += 2) {
      const double radius = std::sqrt(-2 * std::log(1 - rng.uniformDouble()) / samples);
      const double noise = 0.2 * radius * std::cos(2 * std::numbers::pi * rng.uniformDouble());
      image.at(x, y) = image.at(x + 1, y) = grey(static_cast<float>(1 + noise));
    }
  return image;
}

std::vector<WeightedPicture> pictures(int count, Rng& rng) {
  std::vector<WeightedPicture> all;
  for (int i = 0; i < count; ++i) all.push_back({noisy(1 + i % 3, rng), 1.0 + i % 3});
  return all;
}

ToolRun lobecompare(const std::string& arguments) {
  return runBinary(".", "lobecompare " + arguments);
}

}  // namespace

TEST_CASE("agreement: methods of equal expected value fail about as often as the level says") {
  const int count = GENERATE(3, 8);
  constexpr int kTrials = 1000;
  int failures = 0;
  double squares = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    Rng rng(5, static_cast<std::uint64_t>(count), static_cast<std::uint64_t>(trial));
    const Agreement a = testAgreement(pictures(count, rng), pictures(count, rng));
    failures += !a.agree;
    squares += a.z * a.z / kTrials;
  }
  CAPTURE(count, failures);
  CHECK(failures <= 6);  // one is expected
  CHECK(squares == Approx(1).margin(0.15));
}

TEST_CASE("agreement: a difference is found and located") {
  Rng rng(1);
  const std::vector<WeightedPicture> a = pictures(6, rng);
  std::vector<WeightedPicture> b = pictures(6, rng);
  SECTION("in one block") {
    for (WeightedPicture& picture : b)
      for (int y = 16; y < 24; ++y)
        for (int x = 40; x < 48; ++x) picture.image.at(x, y) += grey(0.15f);
    const Agreement result = testAgreement(a, b);
    CHECK_FALSE(result.agree);
    CHECK(result.worstZ > result.limitZ);
    CHECK((result.worstX == 40 && result.worstY == 16));
    CHECK(result.blocks == 6 * 5);
  }
  SECTION("in all of them, too small for any") {
    for (WeightedPicture& picture : b)
      for (Rgb& pixel : picture.image.pixels) pixel *= 1.02f;
    const Agreement result = testAgreement(a, b);
    CHECK_FALSE(result.agree);
    CHECK(result.worstZ < result.limitZ);
    CHECK(result.z > result.limitZ);
    CHECK(result.meanRatio == Approx(1.02).margin(4 * result.meanRatioError));
    CHECK(result.meanRatioError < 0.005);
  }
  SECTION("without variance") {
    const std::vector<WeightedPicture> constant(2, {Image(48, 40, grey(1)), 1});
    std::vector<WeightedPicture> other = constant;
    CHECK(testAgreement(constant, other).agree);
    for (WeightedPicture& picture : other) picture.image.at(0, 0) = grey(1.001f);
    CHECK_FALSE(testAgreement(constant, other).agree);
  }
  SECTION("faults") {
    CHECK_THROWS_WITH(testAgreement(a, std::span(b).first(1)), Catch::Contains("at least two images of each method"));
    b[1].image = Image(48, 39);
    CHECK_THROWS_WITH(testAgreement(a, b), "the image has 48x39 pixels, the first 48x40");
    b[1].image = Image(48, 40, grey(std::numeric_limits<float>::infinity()));
    CHECK_THROWS_WITH(testAgreement(a, b), Catch::Contains("not finite"));
  }
}

TEST_CASE("agreement: lobecompare writes the variance of merged pictures and tests two methods") {
  const Folder folder;
  Rng rng(2);
  std::string a, b;
  for (int i = 0; i < 8; ++i) {
    const double samples = 1 + i % 2;
    const std::string file = folder / fmt::format("{}.exr", i);
    writeImage(file, noisy(samples, rng), {{"integrator", "path"}, {"seed", 1.0 * i}, {"samples", samples}});
    (i < 4 ? a : b) += file + " ";
  }
  const std::string merged = folder / "merged.exr", variance = folder / "variance.exr";
  SECTION("variance") {
    REQUIRE(lobecompare("--merge " + merged + " --variance " + variance + " " + a + b).code == 0);
    double mean = 0;
    const Image written = readImage(variance);
    for (const Rgb& pixel : written.pixels) mean += pixel.x() / static_cast<double>(written.pixels.size());
    CHECK(mean == Approx(0.04 / 12).epsilon(0.05));  // 12 samples altogether
    CHECK(lobecompare("--merge " + merged + " --variance " + variance + " " + a + a).code == 1);
    CHECK(lobecompare("--variance " + variance + " " + a).code == 2);
    const std::string other = folder / "other.exr";
    CHECK(lobecompare("--merge " + other + " --variance /nowhere/v.exr " + a + b).code == 1);
    CHECK(std::filesystem::exists(other));
    CHECK(lobecompare("--merge " + merged + " --variance " + merged + " " + a).code == 2);
    CHECK(lobecompare("--merge " + merged + " --variance " + (folder / "." / "merged.exr").string() + " " + a).code ==
          2);
    CHECK(lobecompare("--merge " + merged + " --variance v.png " + a).code == 2);
  }
  SECTION("faults name the file that has them") {
    const std::string file = folder / "bad.exr", png = folder / "bad.png";
    const auto fault = [&](const std::string& arguments) {
      const ToolRun run = lobecompare(arguments);
      CHECK(run.code == 1);
      CHECK(lineCount(run.error) == 1);
      return run.error;
    };
    writeImage(file, Image(47, 40), {{"integrator", "path"}, {"seed", 9.0}, {"samples", 1.0}});
    CHECK_THAT(fault(a + "--agree-with " + b + file), Catch::Contains(file + ": the image has 47x40 pixels"));
    CHECK_THAT(fault(a + file + " --agree-with " + b), Catch::Contains(file + ": the image has 47x40 pixels"));
    writeImage(file, Image(48, 40, grey(std::numeric_limits<float>::infinity())),
               {{"integrator", "path"}, {"seed", 9.0}, {"samples", 1.0}});
    CHECK_THAT(fault(a + file + " --agree-with " + b), Catch::Contains(file + ": the image has pixels that are not"));
    writeImage(png, Image(48, 40));
    CHECK_THAT(fault(a + png + " --agree-with " + b),
               Catch::Contains(png + ": does not say how many samples it has") && !Catch::Contains("merge"));
  }
  SECTION("pictures of different scenes are noted once") {
    std::string of[2];
    for (int i = 0; i < 4; ++i) {
      const std::string file = folder / fmt::format("scene-{}.exr", i);
      writeImage(file, noisy(1, rng), {{"sceneHash", i < 2 ? "0a" : "0b"}, {"seed", 1.0 * i}, {"samples", 1.0}});
      of[i / 2] += file + " ";
    }
    const ToolRun run = lobecompare(of[0] + "--agree-with " + of[1]);
    CHECK(run.code == 0);
    CHECK(lineCount(run.error) == 1);
    CHECK_THAT(run.error, Catch::Contains("note: ") && Catch::Contains("different scenes or cameras;"));
    CHECK(lobecompare(a + "--agree-with " + of[0]).error.empty());
  }
  SECTION("agreement") {
    const ToolRun run = lobecompare("--json " + a + "--agree-with " + b);
    REQUIRE(run.code == 0);
    const auto json = parseJson(run.out);
    CHECK(json["agree"] == true);
    CHECK(json["blocks"] == 30);
    CHECK_THAT(lobecompare(a + "--agree-with " + b).out, Catch::StartsWith("agree: ratio of means"));
    const ToolRun one = lobecompare(a + "--agree-with " + (folder / "4.exr").string());
    CHECK(one.code == 2);
    CHECK(one.error == "lobecompare: error: --agree-with needs at least two images of each method\n");
    // The only image of the first method must not be joined by one of the second.
    const ToolRun first = lobecompare((folder / "0.exr").string() + " --agree-with " + b);
    CHECK(first.code == 2);
    CHECK(first.error == one.error);
    CHECK(lobecompare(a + "--pair --agree-with " + b).code == 2);
  }
}
