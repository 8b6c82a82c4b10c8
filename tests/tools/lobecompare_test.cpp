// Output, exit codes and one-line errors of lobecompare.

#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "runtime/image/image_output.h"
#include "tests/support/json.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;

namespace {

ToolRun lobecompare(const std::string& arguments) {
  return runBinary(".", "lobecompare " + arguments);
}

}  // namespace

TEST_CASE("render: lobecompare prints error metrics as text and JSON") {
  const Folder folder;
  const std::string reference = folder / "reference.exr", image = folder / "image.exr";
  writeImage(reference, Image(10, 10, grey(0.5f)));
  writeImage(image, Image(10, 10, grey(0.6f)));
  SECTION("numbers") {
    const ToolRun run = lobecompare(reference + " " + image + " " + reference + " --json");
    REQUIRE(run.code == 0);
    const auto json = parseJson(run.out);
    REQUIRE(json.size() == 2);
    CHECK(json[0]["image"] == image);
    CHECK(json[0]["mse"].get<double>() == Approx(0.01));
    CHECK(json[0]["relmse"].get<double>() == Approx(0.01 / 0.26));
    CHECK(json[0]["relmse_drop_0.1pct"].get<double>() == Approx(0.01 / 0.26));
    CHECK(json[0]["relmse_drop_1pct"].get<double>() == Approx(0.01 / 0.26));
    CHECK(json[0]["mean_ratio"].get<double>() == Approx(1.2));
    CHECK(json[0]["nonfinite"] == 0);
    CHECK(json[0]["relmse_error"].get<double>() < 1e-6);
    CHECK(json[0]["worst_0.01pct_fraction"].get<double>() == Approx(0.01));
    CHECK(json[0]["worst_1pct_fraction"].get<double>() == Approx(0.01));
    CHECK(json[0]["fireflies"] == 0);
    CHECK(json[1]["mse"] == 0);
    CHECK(lobecompare(reference + " " + image).out.find("0.01") != std::string::npos);
    CHECK(lobecompare(reference + " " + image).out.find("fireflies") != std::string::npos);
  }
  SECTION("map") {
    const std::string map = folder / "map.png";
    CHECK(lobecompare(reference + " " + image + " --map " + map).code == 0);
    CHECK(readImage(map).width == 10);
    CHECK(lobecompare(reference + " " + image + " " + image + " --map " + map).code == 2);
    CHECK(lobecompare(reference + " " + image + " --map map.jpg").code == 2);
    const ToolRun unwritable = lobecompare(reference + " " + image + " --map /nowhere/map.png");
    CHECK(unwritable.code == 1);
    CHECK(unwritable.error.find("lobecompare: error: /nowhere/map.png: cannot write") == 0);
    CHECK(unwritable.out.find("relmse") != std::string::npos);
  }
  SECTION("a larger reference is averaged down") {
    const std::string large = folder / "large.exr";
    Image pixels(20, 20);
    for (int y = 0; y < 20; ++y)
      for (int x = 0; x < 20; ++x) pixels.at(x, y) = grey((x + y) % 2 == 0 ? 0.2f : 0.8f);
    writeImage(large, pixels);
    const ToolRun run = lobecompare(large + " " + image + " --shrink 2 --json");
    REQUIRE(run.code == 0);
    CHECK(parseJson(run.out)[0]["mse"].get<double>() == Approx(0.01));
    const ToolRun uneven = lobecompare(large + " " + image + " --shrink 3");
    CHECK(uneven.code == 1);
    CHECK(uneven.error ==
          fmt::format("lobecompare: error: {}: 20x20 pixels cannot be divided into blocks of 3x3\n", large));
    CHECK(lobecompare(large + " " + image + " --shrink 0").code == 2);
  }
  SECTION("faults") {
    CHECK(lobecompare("").code == 2);
    CHECK(lobecompare(reference).code == 2);
    CHECK(lobecompare(reference + " " + image + " --unknown").code == 2);
    const std::string other = folder / "other.exr";
    writeImage(other, Image(9, 10));
    const ToolRun sizes = lobecompare(reference + " " + other);
    CHECK(sizes.code == 1);
    CHECK(sizes.error ==
          fmt::format("lobecompare: error: {}: the image has 9x10 pixels, the reference 10x10\n", other));
    const ToolRun missing = lobecompare(reference + " " + (folder / "missing.exr").string());
    CHECK(missing.code == 1);
    CHECK(missing.error.find("missing.exr") != std::string::npos);
  }
}

TEST_CASE("render: lobecompare --pair notes different scenes and integrators, and compares them") {
  const Folder folder;
  const auto write = [&](const char* name, const char* scene, const char* integrator) {
    const std::string path = folder / name;
    writeImage(path, Image(4, 4, grey(0.5f)), {{"sceneHash", scene}, {"integrator", integrator}});
    return path;
  };
  const std::string a = write("a.exr", "0a", "path"), same = write("same.exr", "0a", "path"),
                    other = write("other.exr", "0b", "product");
  CHECK(lobecompare("--pair " + a + " " + same).error.empty());
  const ToolRun run = lobecompare("--pair " + a + " " + other);
  CHECK(run.code == 0);
  CHECK(run.out.find("relative variance") != std::string::npos);
  CHECK(lineCount(run.error) == 2);
  CHECK_THAT(run.error, Catch::Contains("lobecompare: note: " + a + " and " + other) &&
                            Catch::Contains("different scenes or cameras;") &&
                            Catch::Contains("different integrators;"));
}

TEST_CASE("render: lobecompare prints a dash, or null in JSON, for what is not known") {
  const Folder folder;
  std::string black[4], bright[2];
  const auto write = [&](const char* name, int seed, const Image& image) {
    const std::string path = folder / fmt::format("{}-{}.exr", name, seed);
    writeImage(path, image, {{"integrator", "path"}, {"seed", 1.0 * seed}, {"samples", 1.0}});
    return path;
  };
  for (int i = 0; i < 4; ++i) black[i] = write("black", i, Image(16, 10));
  for (int i = 0; i < 2; ++i) bright[i] = write("bright", 4 + i, Image(16, 10, grey(1)));
  const std::string small = write("small", 6, Image(1, 1, grey(1)));
  const auto shown = [](const std::string& arguments) {
    const ToolRun run = lobecompare(arguments);
    CHECK(run.code == 0);
    CHECK_THAT(run.out, !Catch::Contains("nan"));
    return run.out;
  };
  CHECK_THAT(shown("--pair " + bright[0] + " " + bright[1]), Catch::Contains("0 [–]"));
  CHECK_THAT(shown("--pair " + black[0] + " " + black[1]), Catch::Contains("–  "));
  CHECK_THAT(shown(small + " " + small), Catch::Contains("0 ± –"));
  CHECK_THAT(shown(black[0] + " " + black[1]), Catch::Contains(" –  "));
  const std::string agreement = black[0] + " " + black[1] + " --agree-with " + black[2] + " " + black[3];
  CHECK_THAT(shown(agreement), Catch::Contains("agree: ratio of means –, z 0.00;"));
  const std::string other = black[0] + " " + black[1] + " --agree-with " + bright[0] + " " + bright[1];
  CHECK_THAT(shown(other), Catch::Contains("disagree: ratio of means –, z inf;"));
  CHECK(parseJson(shown("--json " + other))["mean_ratio"].is_null());
  CHECK(parseJson(shown("--json --pair " + bright[0] + " " + bright[1]))["relvar_interval"][0].is_null());
  CHECK(parseJson(shown("--json " + small + " " + small))[0]["relmse_error"].is_null());
}

TEST_CASE("render: lobecompare --pair notes what makes the variances of both pictures differ") {
  const Folder folder;
  const auto write = [&](const char* name, const ImageAttributes& attributes) {
    const std::string path = folder / name;
    writeImage(path, Image(4, 4, grey(0.5f)), attributes);
    return path;
  };
  const std::string a = write("a.exr", {{"samples", 100.0}, {"seed", 1.0}}),
                    similar = write("b.exr", {{"samples", 109.0}, {"seed", 2.0}}),
                    more = write("c.exr", {{"samples", 112.0}, {"seed", 3.0}}),
                    l2 = write("d.exr", {{"samples", 100.0}, {"gradients", "l2 (unbiased before clamping)"}}),
                    partial = write("e.exr", {{"seed", 4.0}, {"interrupted", "1 to 2 samples per pixel"}}),
                    png = write("f.png", {});
  const auto notes = [&](const std::string& one, const std::string& other) {
    const ToolRun run = lobecompare("--pair " + one + " " + other);
    CHECK(run.code == 0);
    return run.error;
  };
  const std::string end = "; the result is the mean of both variances\n";
  CHECK(notes(a, similar).empty());
  CHECK(notes(a, png).empty());
  CHECK(notes(l2, l2).empty());
  CHECK(notes(a, more) == "lobecompare: note: " + a + " and " + more + ": have 100 and 112 samples" + end);
  CHECK_THAT(notes(a, l2), Catch::Contains("have different --gradients" + end));
  CHECK_THAT(notes(a, partial),
             Catch::Contains("have different numbers of samples, because a run was interrupted" + end));
}

TEST_CASE("render: lobecompare notes pixels without samples") {
  const Folder folder;
  const std::string whole = folder / "whole.exr", later = folder / "later.exr", first = folder / "first.exr";
  writeImage(whole, Image(4, 4, grey(0.5f)), {{"samples", 2.0}});
  writeImage(later, Image(4, 4, grey(0.5f)), {{"interrupted", "1 to 2 samples per pixel"}});
  writeImage(first, Image(4, 4), {{"interrupted", "0 to 1 samples per pixel"}});
  for (const std::string options : {"", "--json ", "--pair "}) {
    CAPTURE(options);
    const std::string note = "it has 0 to 1 samples per pixel; pixels without a sample are black";
    CHECK_THAT(lobecompare(options + whole + " " + later).error, !Catch::Contains("without a sample"));
    CHECK_THAT(lobecompare(options + whole + " " + first).error,
               Catch::Contains("note: " + first) && Catch::Contains(note));
    CHECK_THAT(lobecompare(options + first + " " + later).error,
               Catch::Contains("note: " + first) && Catch::Contains(note));
  }
}

TEST_CASE("render: lobecompare --pair compares PNG files by their linear values") {
  const Folder folder;
  const std::string a = folder / "a.png", b = folder / "b.png";
  writeImage(a, Image(4, 4, grey(0.2f)));
  writeImage(b, Image(4, 4, grey(0.6f)));
  const ToolRun run = lobecompare("--pair --json " + a + " " + b);
  REQUIRE(run.code == 0);
  CHECK(run.error.empty());
  CHECK(parseJson(run.out)["relvar"].get<double>() == Approx(0.5 * 0.4 * 0.4 / (0.4 * 0.4 + 0.01)).epsilon(0.03));
}

TEST_CASE("render: lobecompare --png writes the picture as loberender does") {
  const Folder folder;
  const std::string input = folder / "a.exr", output = folder / "a.png", direct = folder / "b.png";
  Image image(3, 2, Rgb(0.2f, 0.4f, 3.0f));
  writeImage(input, image);
  writeImage(direct, image);
  REQUIRE(lobecompare("--png " + input + " " + output).code == 0);
  CHECK(readFile(output) == readFile(direct));
  for (Rgb& pixel : image.pixels) pixel *= 0.25f;
  writeImage(direct, image);
  REQUIRE(lobecompare("--png " + input + " " + output + " --exposure -2").code == 0);
  CHECK(readFile(output) == readFile(direct));
  SECTION("faults") {
    const auto fault = [&](const std::string& arguments, int code) {
      const ToolRun run = lobecompare(arguments);
      CAPTURE(arguments, run.error);
      CHECK(run.code == code);
      CHECK(lineCount(run.error) == 1);
      return run.error;
    };
    CHECK_THAT(fault("--png " + input + " " + input, 2), Catch::Contains(".png"));
    CHECK_THAT(fault("--png " + output + " " + output, 2), Catch::Contains("a.png"));
    CHECK_THAT(fault("--png " + input + " " + output + " " + direct, 2), Catch::Contains("two files"));
    CHECK_THAT(fault("--png " + (folder / "c.exr").string() + " " + output, 1), Catch::Contains("c.exr: no such file"));
    CHECK_THAT(fault("--png " + input + " /nowhere/a.png", 1), Catch::Contains("/nowhere/a.png"));
    CHECK(fault("--png --json " + input + " " + output, 2).find("--json") != std::string::npos);
    for (const std::string exposure : {"nan", "101", "inf", "1x"})
      CHECK_THAT(fault("--png " + input + " " + output + " --exposure " + exposure, 2),
                 Catch::Contains("--exposure: must be a number from -100 to 100, not '" + exposure + "'"));
    CHECK_THAT(fault("--exposure 1 " + input + " " + input, 2), Catch::Contains("--png"));
    CHECK_THAT(fault("--exr-type half " + input + " " + input, 2), Catch::Contains("--merge"));
    CHECK(folder.files() == 3);
    CHECK(readFile(output) == readFile(direct));
  }
}

TEST_CASE("render: lobecompare accepts extensions in upper case") {
  const Folder folder;
  const std::string a = folder / "a.EXR", b = folder / "b.exr", merged = folder / "m.EXR", variance = folder / "v.EXR",
                    map = folder / "map.PNG", png = folder / "p.PNG";
  writeImage(a, Image(2, 2, grey(1)), {{"samples", 1.0}});
  writeImage(b, Image(2, 2, grey(1)), {{"samples", 3.0}});
  CHECK(lobecompare("--merge " + merged + " --variance " + variance + " " + a + " " + b).code == 0);
  CHECK(lobecompare(a + " " + b + " --map " + map).code == 0);
  CHECK(lobecompare("--png " + a + " " + png).code == 0);
  CHECK(readImage(merged).width == 2);
  CHECK(folder.files() == 6);
}

TEST_CASE("render: lobecompare --merge writes halves") {
  const Folder folder;
  const std::string a = folder / "a.exr", b = folder / "b.exr", merged = folder / "merged.exr";
  writeImage(a, Image(2, 2, grey(1e6f)), {{"samples", 1.0}});
  writeImage(b, Image(2, 2, grey(1)), {{"samples", 3.0}});
  const ToolRun run = lobecompare("--merge " + merged + " --exr-type half --exr-compression piz " + a + " " + b);
  CHECK(run.code == 0);
  CHECK(run.error ==
        fmt::format("lobecompare: note: {}: 12 values are too large for --exr-type half, and are stored as "
                    "65504\n",
                    merged));
  CHECK(readImage(merged).at(0, 0).x() == kLargestHalf);
  const ToolRun lossy = lobecompare("--merge " + merged + " --exr-compression dwab " + a + " " + b);
  CHECK(lossy.code == 0);
  CHECK(lossy.error ==
        fmt::format("lobecompare: note: {}: 12 values are too large for --exr-compression dwab, and are stored as "
                    "32752\n",
                    merged));
}
