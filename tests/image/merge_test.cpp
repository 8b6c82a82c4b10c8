// Merging of images: the sample-weighted mean, the attributes that are kept, and invalid input.

#include <fmt/format.h>

#include "runtime/core/sampler.h"
#include "runtime/image/merge.h"
#include "tests/support/moments.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;

namespace {

ImageAttributes madeOf(const std::string& integrator, double seed, double offset, double samples) {
  return {{"integrator", integrator}, {"seed", seed}, {"sampleOffset", offset}, {"samples", samples}};
}

/// Images of 3×2 pixels in a temporary folder.
struct Pictures {
  Folder folder;
  std::vector<std::filesystem::path> paths;

  void add(float value, const ImageAttributes& attributes, int width = 3) {
    paths.push_back(folder / fmt::format("{}.exr", paths.size()));
    writeImage(paths.back(), Image(width, 2, Rgb(value, 2 * value, 0)), attributes);
  }
  std::string fault() const {
    try {
      mergeImages(paths);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return {};
  }
};

}  // namespace

TEST_CASE("render: merged images are the sample-weighted mean") {
  Pictures p;
  p.add(1.0f, madeOf("path", 1, 0, 3));
  p.add(2.0f, madeOf("path", 1, 3, 1));
  const MergedImage merged = mergeImages(p.paths);
  REQUIRE((merged.image.width == 3 && merged.image.height == 2));
  for (const Rgb& pixel : merged.image.pixels) CHECK((pixel == Rgb(1.25f, 2.5f, 0)).all());
  CHECK(merged.attributes == madeOf("path", 1, 0, 4));
}

TEST_CASE("render: merged images list their sample ranges and can be merged again") {
  Pictures p;
  p.add(1, madeOf("path", 1, 0, 4));
  p.add(1, madeOf("path", 1, 8, 4));
  p.add(1, madeOf("guided", 1, 0, 4));
  p.paths.push_back(p.folder / "merged.exr");
  const MergedImage merged = mergeImages(std::span(p.paths).first(3));
  CHECK(std::get<double>(merged.attributes.at("samples")) == 12);
  CHECK(std::get<AttributeText>(merged.attributes.at("sampleRanges")) == "guided 1 0 4, path 1 0 4, path 1 8 12");
  CHECK(merged.attributes.count("integrator") == 0);
  CHECK(merged.attributes.count("sampleOffset") == 0);
  writeImage(p.paths[3], merged.image, merged.attributes);

  // Filling the gap joins the samples of path into one range.
  Pictures again;
  again.add(1, madeOf("path", 1, 4, 4));
  again.paths.push_back(p.paths[3]);
  const MergedImage whole = mergeImages(again.paths);
  CHECK(std::get<double>(whole.attributes.at("samples")) == 16);
  CHECK(std::get<AttributeText>(whole.attributes.at("sampleRanges")) == "guided 1 0 4, path 1 0 12");

  Pictures twice;
  twice.add(1, madeOf("path", 1, 11, 1));
  twice.paths.push_back(p.paths[3]);
  CHECK(twice.fault() ==
        fmt::format("{} and {}: both contain samples 11 to 11 of seed 1 and integrator path; change --sample-offset or "
                    "--seed of one",
                    twice.paths[0].string(), twice.paths[1].string()));
}

TEST_CASE("render: equal sample ranges of another seed or integrator can be merged") {
  Pictures p;
  p.add(1, madeOf("path", 1, 0, 4));
  p.add(1, madeOf("path", 2, 0, 4));
  p.add(1, madeOf("product", 1, 0, 4));
  CHECK(p.fault().empty());
  p.add(1, madeOf("path", 2, 3, 1));
  CHECK_THAT(p.fault(), Catch::Contains(p.paths[1].string() + " and " + p.paths[3].string()) &&
                            Catch::Contains("samples 3 to 3 of seed 2 and integrator path"));
}

TEST_CASE("render: overlapping ranges of one image do not hide those of another") {
  for (const auto& [other, fault] : {std::pair{"path 1 9 10", ""}, {"path 1 8 10", "samples 8 to 8 of seed 1"}}) {
    Pictures p;
    p.add(1, {{"samples", 1.0}, {"sampleRanges", other}});
    p.add(1, {{"samples", 1.0}, {"sampleRanges", "path 1 3 4, path 1 0 9, path 1 2 5"}});
    CHECK_THAT(p.fault(), Catch::Contains(fault));
    CHECK(p.fault().empty() == std::string(fault).empty());
  }
}

TEST_CASE("render: images with many sample ranges are merged in time that is proportional to their number") {
  const auto rangesOf = [](int seed, int count) {
    std::string ranges;
    for (int i = 0; i < count; ++i) ranges += fmt::format("{}path {} {} {}", i > 0 ? "," : "", seed, 2 * i, 2 * i + 1);
    return ranges;
  };
  Pictures p;
  for (const int seed : {1, 2}) p.add(1, {{"samples", 1.0}, {"sampleRanges", rangesOf(seed, 500000)}});
  CHECK(std::get<double>(mergeImages(p.paths).attributes.at("samples")) == 2);
  Pictures fewer;
  for (const int seed : {1, 2}) fewer.add(1, {{"samples", 1.0}, {"sampleRanges", rangesOf(seed, 50000)}});
  CHECK_NOTHROW(checkDifferentSeeds(fewer.paths[0], fewer.paths[1]));
}

TEST_CASE("render: merging keeps attributes that all images have in common except times") {
  Pictures p;
  p.add(1, {{"samples", 4.0}, {"software", "x"}, {"cacheHashes", "a"}, {"seconds", 3.0}});
  p.add(3, {{"samples", 4.0}, {"software", "x"}, {"cacheHashes", "b"}, {"seconds", 3.0}});
  const ImageAttributes attributes = mergeImages(p.paths).attributes;
  CHECK(attributes == ImageAttributes{{"samples", 8.0}, {"software", "x"}});
}

TEST_CASE("render: merging combines the fractions of light that a limit has cut off") {
  // Of 3 and 9 samples; 1/3 and 1/5 of the light are cut off. The third picture has no limit.
  ImageAttributes first = madeOf("path", 1, 0, 3), second = madeOf("path", 1, 3, 9);
  first["fireflyLimit"] = second["fireflyLimit"] = 2.0;
  first["fireflyCut"] = 1.0 / 3, second["fireflyCut"] = 1.0 / 5;
  Pictures p;
  p.add(2, first);
  p.add(4, second);
  const ImageAttributes both = mergeImages(p.paths).attributes;
  CHECK(std::get<double>(both.at("fireflyLimit")) == 2);
  CHECK(std::get<double>(both.at("fireflyCut")) == Approx((3 * 1 + 9 * 1) / (3 * 3.0 + 9 * 5)));
  p.add(1, madeOf("path", 1, 12, 6));
  const ImageAttributes all = mergeImages(p.paths).attributes;
  CHECK(all.count("fireflyLimit") == 0);
  CHECK(std::get<double>(all.at("fireflyCut")) == Approx((3 * 1 + 9 * 1) / (3 * 3.0 + 9 * 5 + 6)));
}

TEST_CASE("render: pictures from gradients are merged if they are reconstructed in L2") {
  ImageAttributes first = madeOf("path", 1, 0, 3), second = madeOf("path", 2, 0, 9);
  first["gradients"] = second["gradients"] = "l2 (unbiased before clamping)";
  first["clampedFraction"] = 0.5, second["clampedFraction"] = 0.25;
  Pictures p;
  p.add(2, first);
  p.add(4, second);
  const ImageAttributes both = mergeImages(p.paths).attributes;
  CHECK(both.at("gradients") == first.at("gradients"));
  CHECK(std::get<double>(both.at("clampedFraction")) == Approx((3 * 2 * 0.5 + 9 * 4 * 0.25) / (3 * 2 + 9 * 4)));
  p.add(1, madeOf("path", 3, 0, 6));  // without gradients
  const ImageAttributes all = mergeImages(p.paths).attributes;
  CHECK(all.count("gradients") == 0);
  CHECK(std::get<double>(all.at("clampedFraction")) == Approx((3 * 2 * 0.5 + 9 * 4 * 0.25) / (3 * 2 + 9 * 4 + 6 * 1)));
  ImageAttributes biased = madeOf("path", 4, 0, 6);
  biased["gradients"] = "l1 (biased)";
  p.add(1, biased);
  CHECK_THAT(p.fault(), Catch::Contains(p.paths[3].string() + ": pictures of --gradients l1 cannot be merged"));
}

TEST_CASE("render: errors name the images that cannot be merged") {
  Pictures sizes;
  sizes.add(1, madeOf("path", 1, 0, 4));
  sizes.add(1, madeOf("path", 1, 4, 4), 4);
  CHECK(sizes.fault() ==
        fmt::format("{}: has 4x2 pixels, but {} has 3x2", sizes.paths[1].string(), sizes.paths[0].string()));
  for (const ImageAttributes& attributes :
       {ImageAttributes{}, {{"samples", 0.0}}, {{"samples", -1.0}}, {{"samples", 1.5}}, {{"samples", "many"}}}) {
    Pictures p;
    p.add(1, madeOf("path", 1, 0, 4));
    p.add(1, attributes);
    CHECK_THAT(p.fault(), Catch::Contains(p.paths[1].string() + ": does not say how many samples"));
  }
  Pictures interrupted;
  interrupted.add(1, {{"interrupted", "3 to 5 samples per pixel"}});
  CHECK_THAT(interrupted.fault(), Catch::Contains("3 to 5 samples per pixel") && Catch::Contains("--resume"));
  for (const char* ranges : {"path 1 0", "path 1 4 4", "path 1 0 4 5", "path one 0 4", "path 1 0 4,"}) {
    Pictures p;
    p.add(1, {{"samples", 4.0}, {"sampleRanges", ranges}});
    CAPTURE(ranges);
    CHECK(p.fault().empty() == (std::string(ranges) == "path 1 0 4,"));
  }
  Pictures png;
  png.paths.push_back(png.folder / "a.png");
  writeImage(png.paths[0], Image(2, 2));
  CHECK_THAT(png.fault(), Catch::Contains("a.png: does not say"));
  png.paths[0] = png.folder / "none.exr";
  CHECK_THAT(png.fault(), Catch::Contains("none.exr"));
}

TEST_CASE("render: lobecompare --merge writes the merged image") {
  Pictures p;
  p.add(1, madeOf("path", 1, 0, 3));
  p.add(2, madeOf("path", 1, 3, 1));
  const std::string out = p.folder / "out.exr", both = p.paths[0].string() + " " + p.paths[1].string();
  const ToolRun run = runBinary(".", "lobecompare --merge " + out + " " + both);
  CAPTURE(run.error);
  CHECK((run.code == 0 && run.out.empty() && run.error.empty()));
  CHECK(readImage(out).at(0, 0).x() == 1.25f);
  CHECK(readAttributes(out) == madeOf("path", 1, 0, 4));
  const auto code = [&](const std::string& arguments) { return runBinary(".", "lobecompare " + arguments).code; };
  CHECK(code("--merge out.png " + both) == 2);
  CHECK(code("--merge " + p.paths[0].string() + " " + both) == 2);
  CHECK(code("--merge " + out + " --json " + both) == 2);
  CHECK(code("--merge " + out + " " + p.paths[0].string()) == 2);
  CHECK(code("--merge " + out + " " + p.paths[0].string() + " " + p.paths[0].string()) == 1);
  CHECK(code("--merge /nowhere/out.exr " + both) == 1);
}

TEST_CASE("render: merged AOVs are those of all samples together") {
  // Pixels with known samples, in two parts of 3 and 5 of them.
  Sampler rng(1, 2, 3);
  constexpr int kWidth = 4, kHeight = 3;
  const auto write = [&](const std::filesystem::path& path, const std::vector<std::vector<float>>& samples) {
    Image mean(kWidth, kHeight), variance = mean, depth = mean, count = mean, albedo = mean;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      Moments moments;
      for (const float value : samples[i]) moments.add(value);
      mean.pixels[i] = grey(static_cast<float>(moments.mean()));
      variance.pixels[i] = grey(static_cast<float>(moments.error() * moments.error()));
      depth.pixels[i] = grey(*std::ranges::min_element(samples[i]));
      count.pixels[i] = grey(static_cast<float>(samples[i].size()));
      albedo.pixels[i] = mean.pixels[i] * Rgb(1, 2, 3);
    }
    const Aovs aovs{{Aov::albedo, albedo}, {Aov::depth, depth}, {Aov::variance, variance}, {Aov::samples, count}};
    writeImage(path, mean, {{"samples", static_cast<double>(samples[0].size())}}, layersOf(aovs));
  };
  std::vector<std::vector<float>> first(kWidth * kHeight), second = first, all = first;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (int s = 0; s < 3; ++s) first[i].push_back(10 + rng.uniform());
    for (int s = 0; s < 5; ++s) second[i].push_back(11 + rng.uniform());
    all[i] = first[i];
    all[i].insert(all[i].end(), second[i].begin(), second[i].end());
  }
  const Folder folder;
  write(folder / "a.exr", first);
  write(folder / "b.exr", second);
  write(folder / "c.exr", all);
  const std::vector<std::filesystem::path> parts{folder / "a.exr", folder / "b.exr"};
  const Aovs merged = mergeImages(parts).aovs, whole = readAovs(folder / "c.exr");
  REQUIRE(merged.size() == 4);
  for (const auto& [aov, image] : whole)
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      CHECK((merged.at(aov).pixels[i] / image.pixels[i] - 1).abs().maxCoeff() < 1e-5f);
}

TEST_CASE("render: merged images keep the AOVs that all of them have") {
  const Folder folder;
  const Image image(2, 2, grey(1));
  writeImage(folder / "a.exr", image, {{"samples", 1.0}}, layersOf({{Aov::normal, image}, {Aov::depth, image}}));
  writeImage(folder / "b.exr", image, {{"samples", 1.0}}, layersOf({{Aov::depth, image}, {Aov::albedo, image}}));
  const std::vector<std::filesystem::path> parts{folder / "a.exr", folder / "b.exr"};
  const Aovs merged = mergeImages(parts).aovs;
  CHECK(merged.size() == 1);
  CHECK(merged.contains(Aov::depth));
}
