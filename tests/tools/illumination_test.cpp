// Illumination files: train once, then render elsewhere or in parts.

#include <catch2/catch.hpp>

#include "runtime/image/image.h"
#include "runtime/image/image_output.h"
#include "tests/support/json.h"
#include "tests/support/loberender_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

const std::string kSave = "loberender scene.xml --spp 2 -o trained.exr --save-illumination a.illum" + kTraining;

}  // namespace

TEST_CASE("loberender: rendering with saved illumination reproduces the image") {
  const SceneFolder folder(true);
  for (const std::string integrator : {" --integrator product", " --integrator guided"}) {
    REQUIRE(folder.run(kSave + integrator + " --threads 2").code == 0);
    const std::string stored = folder.bytes("a.illum");
    const ToolRun restored =
        folder.run("loberender scene.xml --spp 2 -o again.exr --stats s.json --illumination a.illum" + integrator);
    CAPTURE(restored.error);
    REQUIRE(restored.code == 0);
    CHECK(folder.bytes("again.exr") == folder.bytes("trained.exr"));
    const auto s = parseJson(folder.bytes("s.json"));
    CHECK((s.at("seconds_training") == 0 && s.at("training_passes").empty() && s.at("records") > 0));

    REQUIRE(folder.run(kSave + integrator + " --threads 1").code == 0);
    CHECK(folder.bytes("a.illum") == stored);
    REQUIRE(folder.run(kSave + integrator + " --seed 2").code == 0);
    CHECK(folder.bytes("a.illum") != stored);
  }
}

TEST_CASE("loberender: product notes illumination without learnt BSDF sampling fractions") {
  const SceneFolder folder(true);
  const std::string note = "have learnt no BSDF sampling fractions";
  const auto noteOf = [&](const std::string& integrator) {
    return folder.run("loberender scene.xml --spp 1 -o a.exr --illumination a.illum --integrator " + integrator).error;
  };
  REQUIRE(folder.run(kSave).code == 0);
  const std::string learnt = folder.bytes("a.illum");
  CHECK_THAT(noteOf("product"), !Catch::Contains(note));
  REQUIRE(folder.run(kSave + " --bsdf-fraction fixed").code == 0);
  CHECK(folder.bytes("a.illum") != learnt);
  CHECK_THAT(noteOf("product"), Catch::Contains(note));
  REQUIRE(folder.run(kSave + " --integrator guided").code == 0);
  CHECK_THAT(noteOf("product"), Catch::Contains(note));
  CHECK_THAT(noteOf("guided"), !Catch::Contains(note));

  const std::string unused =
      "loberender scene.xml --spp 1 -o a.exr --bsdf-fraction fixed --passes 1 --photons 100 --importons 100 "
      "--integrator ";
  CHECK_THAT(folder.run(unused + "path").error,
             Catch::Contains("path ignores --passes, --photons, --importons, --bsdf-fraction"));
  CHECK_THAT(folder.run(unused + "guided").error, Catch::Contains("guided ignores --bsdf-fraction"));
  CHECK_THAT(folder.run(unused + "product").error, !Catch::Contains("ignores"));
}

TEST_CASE("loberender: illumination can be used with other cameras but not with other scenes") {
  const SceneFolder folder(false);
  const std::string guided = " --integrator guided --spp 1";
  REQUIRE(folder.run(kSave + " --integrator guided").code == 0);
  const std::string use = "loberender other.xml -o a.exr --illumination a.illum" + guided;
  std::string text = kScene;
  folder.write("other.xml", text.replace(text.find("value=\"50\""), 10, "value=\"60\""));
  CHECK(folder.run(use + " --size 8x6 --seed 5").code == 0);

  text.replace(text.find("value=\"0.15\""), 12, "value=\"0.16\"");
  folder.write("other.xml", text);
  CHECK_THAT(fault(folder, use, 1), Catch::Contains("a.illum: trained for another scene") &&
                                        Catch::Contains("/scene.xml") && Catch::Contains("--save-illumination"));
}

TEST_CASE("loberender: errors explain why an illumination file is invalid") {
  const SceneFolder folder(true);
  REQUIRE(folder.run(kSave).code == 0);
  const std::string whole = folder.bytes("a.illum");
  const std::string use = "loberender scene.xml --spp 1 -o b.exr --illumination a.illum";
  std::string flipped = whole, newer = whole;
  flipped[whole.size() / 2] = static_cast<char>(~flipped[whole.size() / 2]);
  newer[8] = 99;
  const std::vector<std::pair<std::string, std::string>> cases{{whole.substr(0, whole.size() / 2), "truncated"},
                                                               {flipped, "damaged"},
                                                               {newer, "newer than this program's"},
                                                               {readFile(folder.caches().front()), "of kind 'BRDF'"},
                                                               {"", "empty"}};
  for (const auto& [bytes, word] : cases) {
    folder.write("a.illum", bytes);
    CHECK_THAT(fault(folder, use, 1), Catch::Contains("a.illum: ") && Catch::Contains(word));
  }
  CHECK_THAT(fault(folder, use + "none", 1), Catch::Contains("a.illumnone: no such file"));
}

TEST_CASE("loberender: training goes on from stored illumination, which the new camera extends") {
  const SceneFolder folder(true);
  std::string camera = kScene;
  camera.replace(camera.find("0, 2, 6"), 7, "6, 2, 0");  // from another side
  folder.write("other.xml", camera);
  REQUIRE(folder.run(kSave).code == 0);
  const auto recordsOf = [&](const std::string& stats) {
    return parseJson(folder.bytes(stats)).at("records").get<int>();
  };
  const std::string use = "loberender scene.xml --camera other.xml --spp 2 --illumination a.illum";
  REQUIRE(folder.run(use + " -o plain.exr --stats plain.json").code == 0);
  const std::string further = use + kTraining + " --checkpoint run.ckpt --save-illumination b.illum";
  REQUIRE(folder.run(further + " -o a.exr --stats further.json --threads 1").code == 0);
  CHECK(recordsOf("further.json") > recordsOf("plain.json"));
  const std::string picture = folder.bytes("a.exr"), stored = folder.bytes("b.illum");
  SECTION("the same bytes on other threads, from the stored result, and in a resumed run") {
    REQUIRE(folder.run(further + " -o a.exr --threads 7").code == 0);
    CHECK((folder.bytes("a.exr") == picture && folder.bytes("b.illum") == stored));
    REQUIRE(folder.run("loberender other.xml --spp 2 -o a.exr --illumination b.illum").code == 0);
    CHECK(folder.bytes("a.exr") == picture);
    const std::string resumed = use + kTraining + " --resume run.ckpt -o a.exr";
    REQUIRE(folder.run(resumed).code == 0);
    CHECK(folder.bytes("a.exr") == picture);
  }
  SECTION("with the same camera, few records are missing") {
    REQUIRE(
        folder.run("loberender scene.xml --spp 1 -o a.exr --illumination a.illum --stats same.json" + kTraining).code ==
        0);
    CHECK(recordsOf("same.json") - recordsOf("plain.json") < recordsOf("further.json") - recordsOf("plain.json"));
  }
}

TEST_CASE("loberender: illumination is trained for the maximum path length of the picture") {
  const SceneFolder folder(false);
  const std::string guided = " --integrator guided", note = "a.illum: trained for paths of up to 3 segments";
  const auto depthOf = [&](const std::string& name) {
    return parseJson(folder.run("lobedump --json " + name).out).at(0).at("settings").at("max_depth");
  };
  REQUIRE(folder.run(kSave + guided).code == 0);
  CHECK(depthOf("a.illum").is_null());
  const std::string unlimited = folder.bytes("a.illum");
  REQUIRE(folder.run(kSave + guided + " --max-depth 3").code == 0);
  CHECK(depthOf("a.illum") == 3);
  CHECK(folder.bytes("a.illum") != unlimited);
  CHECK_THAT(folder.run("lobedump a.illum").out, Catch::Contains("paths of up to 3 segments"));

  const std::string use = "loberender scene.xml --spp 1 -o a.exr --illumination a.illum" + guided;
  CHECK_THAT(folder.run(use).error, Catch::Contains(note));
  CHECK_THAT(folder.run(use + " --max-depth 3").error, !Catch::Contains(note));
  REQUIRE(folder.run(use + kTraining + " --save-illumination b.illum").code == 0);
  CHECK(depthOf("b.illum") == 3);

  std::string text = kScene;
  const std::string integrator = R"(<integrator type="path"><integer name="maxDepth" value="3"/></integrator>)";
  folder.write("scene.xml", text.insert(text.find("<sensor"), integrator));
  const std::string limited = folder.bytes("a.illum");
  REQUIRE(folder.run(kSave + guided).code == 0);
  CHECK(folder.bytes("a.illum") == limited);
}

TEST_CASE("loberender: the sensor can come from another file") {
  const SceneFolder folder(false);
  const std::string path = " --integrator path --spp 2 ";
  std::string other = kScene;
  other.replace(other.find("value=\"16\""), 10, "value=\"20\"");
  other.replace(other.find("0, 2, 6"), 7, "1, 3, 5");
  folder.write("other.xml", other);
  // Only the sensor, with a parameter; the scene has none of this name.
  const std::size_t begin = other.find("<sensor"), end = other.find("</sensor>") + 9;
  std::string sensor = other.substr(begin, end - begin);
  sensor.replace(sensor.find("value=\"50\""), 10, "value=\"$fov\"");
  folder.write("camera.xml", "<scene version=\"0.6.0\">" + sensor + "</scene>");
  REQUIRE(folder.run("loberender other.xml -o a.exr" + path).code == 0);
  const ToolRun run = folder.run("loberender scene.xml --camera camera.xml -D fov=50 -o b.exr" + path);
  CAPTURE(run.error);
  REQUIRE(run.code == 0);
  CHECK(folder.bytes("a.exr") == folder.bytes("b.exr"));
  SECTION("errors") {
    const std::string use = "loberender scene.xml -o c.exr --integrator path --spp 1 --camera ";
    folder.write("empty.xml", "<scene version=\"0.6.0\"><bsdf type=\"diffuse\"/></scene>");
    CHECK_THAT(fault(folder, use + "empty.xml", 1), Catch::Contains("empty.xml:1:1: the file has no <sensor>"));
    CHECK_THAT(fault(folder, use + "gone.xml", 1), Catch::Contains("gone.xml"));
    CHECK_THAT(fault(folder, use + "camera.xml", 1), Catch::Contains("camera.xml:1:") && Catch::Contains("$fov"));
    CHECK_THAT(
        fault(folder, use + "camera.xml -D fov=50 -D angle=1", 1),
        Catch::Contains("-D defines $angle, which neither file uses; scene.xml uses none, and camera.xml uses fov"));
    CHECK_THAT(fault(folder, use + "camera.xml -D fov=50 --stats camera.xml", 2), Catch::Contains("camera.xml"));
    // lobefit accepts the definitions of the camera, too.
    const std::string line =
        fault(folder, "loberender scene.xml -o c.exr --integrator product --spp 1 --camera camera.xml -D fov=50", 1);
    CHECK_THAT(line, Catch::Contains("run: lobefit") && Catch::Contains("--camera camera.xml -D fov=50"));
    CHECK(folder.run("lobefit scene.xml --check --camera camera.xml -D fov=50").code == 0);
    CHECK(folder.run("lobefit scene.xml --check -D fov=50").code == 1);
  }
}

TEST_CASE("loberender: options that conflict with an illumination file are errors") {
  const SceneFolder folder(false);
  const std::vector<std::pair<std::string, std::string>> cases{
      {" --illumination a.illum --train paths", "--train"},
      {" --illumination a.illum --components 4", "--components"},
      {" --illumination a.illum --photons 100", "--photons has no effect with --illumination, except with --passes or"},
      {" --illumination a.illum --bsdf-fraction fixed", "--bsdf-fraction"},
      {" --bsdf-fraction all", "--bsdf-fraction"},
      {" --components 9", "--components"},
      {" --photons 0", "--photons"},
      {" --illumination a.illum --save-illumination b.illum", "--save-illumination"},
      {" --illumination a.illum --integrator path", "require --integrator auto, guided or product"},
      {" --save-illumination a.illum --integrator path", "require --integrator auto, guided or product"},
      {" --save-illumination a.exr", "a.exr"},
      {" --sample-offset -1", "--sample-offset"},
      {" --sample-offset 2147483647", "at most 2147483647"}};
  for (const auto& [options, word] : cases)
    CHECK_THAT(fault(folder, "loberender scene.xml --spp 1 -o a.exr" + options, 2), Catch::Contains(word));
  CHECK_THAT(fault(folder, "loberender scene.xml --seconds 1 -o a.exr --sample-offset 1", 2), Catch::Contains("--spp"));
  CHECK_THAT(fault(folder, "loberender scene.xml --spp 1 -o a.exr --save-illumination none/a.illum", 1),
             Catch::Contains("cannot write"));
}

TEST_CASE("loberender: partial renderings merge into the whole image") {
  const SceneFolder folder(false);
  const std::string render = "loberender scene.xml --integrator guided --illumination a.illum";
  REQUIRE(folder.run(kSave + " --integrator guided").code == 0);
  REQUIRE(folder.run(render + " --spp 8 -o whole.exr").code == 0);
  REQUIRE(folder.run(render + " --spp 3 -o a.exr").code == 0);
  REQUIRE(folder.run(render + " --spp 4 --sample-offset 3 -o b.exr").code == 0);
  REQUIRE(folder.run(render + " --spp 1 --sample-offset 7 -o c.exr").code == 0);
  // A merged image can be merged again.
  REQUIRE(folder.run("lobecompare --merge bc.exr c.exr b.exr").code == 0);
  REQUIRE(folder.run("lobecompare --merge merged.exr a.exr bc.exr").code == 0);

  const Image whole = readImage(folder / "whole.exr"), merged = readImage(folder / "merged.exr");
  REQUIRE(whole.pixels.size() == merged.pixels.size());
  float worst = 0;
  for (std::size_t i = 0; i < whole.pixels.size(); ++i)
    worst = std::max(worst, ((whole.pixels[i] - merged.pixels[i]) / (whole.pixels[i] + 1e-3f)).abs().maxCoeff());
  CHECK(worst < 1e-6f);
  CHECK(readAttributes(folder / "merged.exr") == readAttributes(folder / "whole.exr"));
  CHECK(folder.bytes("a.exr") != folder.bytes("c.exr"));

  const ToolRun overlap = folder.run("lobecompare --merge d.exr a.exr whole.exr");
  CHECK(overlap.code == 1);
  CHECK_THAT(overlap.error,
             Catch::Contains("a.exr and whole.exr: both contain samples 0 to 2 of seed 1 and integrator guided"));
  CHECK_FALSE(folder.has("d.exr"));

  REQUIRE(folder.run("loberender scene.xml --integrator path --spp 1 --size 4x4 -o other.exr").code == 0);
  const ToolRun mixed = folder.run("lobecompare --merge d.exr a.exr other.exr");
  CHECK(mixed.code == 1);
  CHECK_THAT(mixed.error, Catch::Contains("of different scenes or cameras"));
  CHECK_THAT(folder.run("lobecompare --merge d.exr a.exr none.exr").error, Catch::Contains("none.exr: no such file"));
}

TEST_CASE("lobedump: shows illumination as text and JSON and as a point cloud") {
  const SceneFolder folder(true);
  REQUIRE(folder.run(kSave).code == 0);
  const ToolRun text = folder.run("lobedump a.illum");
  CHECK(text.code == 0);
  CHECK_THAT(text.out,
             Catch::Contains("/scene.xml, hash") && Catch::Contains("from both, 1 passes of 2000 photons and 1000") &&
                 Catch::Contains("radius") && Catch::Contains("undersampled") && Catch::Contains("learnt fractions"));
  const auto json = parseJson(folder.run("lobedump --json a.illum").out).at(0);
  const long records = json.at("record_count");
  REQUIRE(records > 1);
  CHECK(json.at("bytes") == folder.bytes("a.illum").size());
  CHECK(static_cast<double>(json.at("bytes")) < 600.0 * static_cast<double>(records) + 2000);
  CHECK((json.at("settings").at("seed") == 1 && json.at("settings").at("from") == "both"));
  CHECK(json.at("settings").at("learnt_fractions") == true);
  CHECK_FALSE(json.contains("records"));
  const auto& radius = json.at("distributions").at("radius");
  CHECK((radius.at("min") > 0 && radius.at("min") <= radius.at("median") && radius.at("max") <= json.at("unit")));
  const auto all = parseJson(folder.run("lobedump --json --records a.illum").out).at(0);
  CHECK(static_cast<long>(all.at("records").size()) == records);
  CHECK(lineCount(folder.run("lobedump --records a.illum").out) == lineCount(text.out) + records + 1);

  REQUIRE(folder.run("lobedump a.illum --points p.ply").code == 0);
  CHECK(folder.run("lobedump a.illum --points upper.PLY").code == 0);
  const std::string ply = folder.bytes("p.ply"), end = "end_header\n";
  CHECK_THAT(ply, Catch::StartsWith("ply\n") && Catch::Contains("element vertex " + std::to_string(records) + "\n"));
  CHECK(ply.size() == ply.find(end) + end.size() + static_cast<std::size_t>(records) * 11 * sizeof(float));

  const std::string lobe = folder.caches().front().string();
  CHECK(folder.run("lobedump a.illum " + lobe).code == 2);
  CHECK(folder.run("lobedump --points p.ply " + lobe).code == 2);
  CHECK(folder.run("lobedump --points p.obj a.illum").code == 2);
  CHECK(folder.run("lobedump --diff a.illum a.illum").code == 2);
  REQUIRE(folder.run("loberender scene.xml -o a.exr --integrator path --spp 1 --checkpoint run.ckpt").code == 0);
  for (const std::string arguments : {"run.ckpt", "a.illum run.ckpt", "--diff run.ckpt run.ckpt"})
    CHECK_THAT(folder.run("lobedump " + arguments).error,
               Catch::Contains("run.ckpt: a checkpoint; lobedump reads .lobe and .illum files"));
  CHECK(folder.run("lobedump gone.illum").code == 1);

  CHECK(folder.run("lobedump --html light.html a.illum").code == 0);
  CHECK_THAT(folder.bytes("light.html"),
             Catch::StartsWith("<!DOCTYPE html>") && Catch::Contains("a.illum") && Catch::Contains("likelihood gain"));
  CHECK(folder.run("lobedump --html x.html --scene scene.xml a.illum").code == 2);
  CHECK(folder.run("lobedump --html x.html a.illum --points p.ply").code == 2);
}
