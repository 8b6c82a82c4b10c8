// AOVs in the pictures of loberender: every integrator, threads, resumed runs, parts, and errors.

#include <fmt/format.h>

#include "runtime/image/aov.h"
#include "tests/support/loberender_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

bool equal(const Image& a, const Image& b) {
  return std::ranges::equal(a.pixels, b.pixels, [](const Rgb& x, const Rgb& y) { return (x == y).all(); });
}

float largestDifference(const Image& a, const Image& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    largest = std::max(largest, ((a.pixels[i] - b.pixels[i]) / (b.pixels[i].abs() + 1e-3f)).abs().maxCoeff());
  return largest;
}

std::string renderWith(const std::string& options) {
  return "loberender scene.xml --cache lobes" + kTraining + " " + options;
}

}  // namespace

TEST_CASE("AOVs: with every integrator the picture stays as it is, and the features are the same") {
  const SceneFolder folder(true);
  Aovs features;
  for (const std::string integrator :
       {"path", "guided", "product", "auto", "bdpt", "vcm", "path --gradients l2", "product --light-paths on"}) {
    const bool gradients = integrator.find("gradients") != std::string::npos;
    const std::string options = fmt::format("--spp 3 --integrator {}", integrator);
    CAPTURE(integrator);
    REQUIRE(folder.run(renderWith(options + " -o plain.exr")).code == 0);
    const std::string list = gradients ? "albedo,normal,depth,samples" : "all";
    REQUIRE(folder.run(renderWith(fmt::format("{} -o a.exr -o a.png --aov {}", options, list))).code == 0);
    CHECK(equal(readImage(folder / "a.exr"), readImage(folder / "plain.exr")));
    CHECK(readAovs(folder / "plain.exr").empty());
    const Aovs aovs = readAovs(folder / "a.exr");
    REQUIRE(aovs.size() == (gradients ? 4 : 5));
    for (const Rgb& count : aovs.at(Aov::samples).pixels) CHECK(count.x() == 3);
    if (features.empty()) features = aovs;
    for (const Aov aov : {Aov::albedo, Aov::normal, Aov::depth}) CHECK(equal(aovs.at(aov), features.at(aov)));
  }
}

TEST_CASE("AOVs: the same bytes on any number of threads, and in resumed runs") {
  const SceneFolder folder(true);
  const std::string options = "--integrator product --aov all";
  REQUIRE(folder.run(renderWith(options + " --spp 4 --threads 1 -o one.exr")).code == 0);
  for (const int threads : {2, 7}) {
    REQUIRE(folder.run(renderWith(fmt::format("{} --spp 4 --threads {} -o more.exr", options, threads))).code == 0);
    CHECK(folder.bytes("more.exr") == folder.bytes("one.exr"));
  }
  // The first part of the run stores no AOVs.
  REQUIRE(folder.run(renderWith("--integrator product --spp 2 --checkpoint run.ckpt -o two.exr")).code == 0);
  REQUIRE(folder.run(renderWith(options + " --spp 4 --checkpoint run.ckpt --resume run.ckpt -o resumed.exr")).code ==
          0);
  CHECK(folder.bytes("resumed.exr") == folder.bytes("one.exr"));
}

TEST_CASE("AOVs: those of merged parts are those of the whole picture") {
  const SceneFolder folder(false);
  const std::string options = "loberender scene.xml --integrator path --aov all ";
  REQUIRE(folder.run(options + "--spp 8 -o whole.exr").code == 0);
  REQUIRE(folder.run(options + "--spp 3 -o a.exr").code == 0);
  REQUIRE(folder.run(options + "--spp 5 --sample-offset 3 -o b.exr").code == 0);
  REQUIRE(folder.run("lobecompare --merge merged.exr a.exr b.exr").code == 0);
  const Aovs merged = readAovs(folder / "merged.exr"), whole = readAovs(folder / "whole.exr");
  REQUIRE(merged.size() == whole.size());
  for (const auto& [aov, image] : whole) CHECK(largestDifference(merged.at(aov), image) < 1e-4f);
}

TEST_CASE("AOVs: variance and number of samples are not stored with a compression that changes them") {
  const SceneFolder folder(false);
  const std::string render = "loberender scene.xml --spp 2 --integrator path --exr-compression ";
  for (const std::string options : {"dwaa --aov all", "dwab --aov albedo,variance", "dwab --aov samples"})
    CHECK_THAT(fault(folder, render + options + " -o a.exr", 2),
               Catch::Contains("--exr-compression " + options.substr(0, 4)) && Catch::Contains("use zip"));
  CHECK(folder.run(render + "dwaa --aov all -o a.png").code == 0);
  CHECK(folder.run(render + "dwaa --aov albedo,normal,depth -o a.exr").code == 0);
  REQUIRE(folder.run(render + "zip --aov samples -o a.exr").code == 0);
  REQUIRE(folder.run(render + "zip --aov samples --seed 2 -o b.exr").code == 0);
  const ToolRun merge = folder.run("lobecompare --merge c.exr a.exr b.exr --exr-compression dwaa --variance v.exr");
  CHECK(merge.code == 2);
  CHECK_THAT(merge.error, Catch::Contains("--exr-compression dwaa") && Catch::Contains("use zip"));
  CHECK(!folder.has("c.exr"));
  CHECK(!folder.has("v.exr"));
  CHECK(folder.run("lobecompare --merge c.exr a.exr b.exr").code == 0);
}

TEST_CASE("AOVs: wrong lists are errors that name the known ones") {
  const SceneFolder folder(false);
  for (const std::string list : {"colour", "albedo,depths", "albedo,,depth", "Albedo"})
    CHECK_THAT(fault(folder, "loberender scene.xml -o a.exr --spp 1 --integrator path --aov " + list, 2),
               Catch::Contains("is not one of albedo, normal, depth, variance, samples, or all"));
  CHECK_THAT(fault(folder, "loberender scene.xml -o a.exr --spp 2 --integrator path --gradients l2 --aov all", 2),
             Catch::Contains("--gradients cannot be combined with --aov variance"));
}
