// Images, statistics and one-line errors of loberender.

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <ImfDoubleAttribute.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "runtime/image/image_output.h"
#include "runtime/render/integrators/pilot.h"
#include "schema/lobe_cache.h"
#include "tests/support/json.h"
#include "tests/support/loberender_test_tools.h"

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

namespace {

double number(const Imf::Header& header, const char* name) {
  return header.typedAttribute<Imf::DoubleAttribute>(name).value();
}

}  // namespace

TEST_CASE("loberender and lobefit: replaced parts of a scene are noted") {
  const SceneFolder folder(false);
  std::string text = kScene;
  text.insert(text.find("<sensor"), "<integrator type=\"volpath\"/>");
  folder.write("scene.xml", text);
  for (const std::string tool : {"loberender", "lobefit"}) {
    const ToolRun run =
        folder.run(tool == "lobefit" ? kQuickFit : "loberender scene.xml -o a.exr --integrator path --spp 1");
    CAPTURE(run.error);
    CHECK(run.error.starts_with(tool + ": note: integrator \"volpath\" is ignored"));
  }
}

TEST_CASE("loberender: the error for missing caches gives the command that creates them") {
  const SceneFolder folder(false);
  const std::string line = fault(folder, kRender, 1);
  CHECK_THAT(line, Catch::Contains("Steel, Iron") && Catch::Contains("Satin") && Catch::Contains(".lobe: missing"));
  const std::size_t command = line.find("run: lobefit ");
  REQUIRE(command != std::string::npos);
  const ToolRun fit = folder.run(line.substr(command + 5, line.size() - command - 6));
  CAPTURE(fit.error);
  REQUIRE(fit.code == 0);
  const ToolRun run = folder.run(kRender);
  CAPTURE(run.error);
  CHECK(run.code == 0);
  CHECK(run.out.empty());
  CHECK(readImage(folder / "a.exr").width == 16);
}

TEST_CASE("loberender: the command that creates the caches is quoted for the shell") {
  const SceneFolder folder(false);
  std::string scene = kScene;
  scene.replace(scene.find("0.15"), 4, "$roughness");
  folder.write("it's a scene.xml", scene);
  const std::string render = R"(loberender "it's a scene.xml" -o a.exr --spp 1 --cache "my lobes" -D "roughness= 0.2")";
  const std::string line = fault(folder, render + kTraining, 1);
  const std::size_t command = line.find("run: lobefit ");
  REQUIRE(command != std::string::npos);
  const std::string fit = line.substr(command + 5, line.size() - command - 6);
  CAPTURE(fit);
  CHECK(folder.run(fit + " --elevations 4 --samples 256").code == 0);
  CHECK(folder.run(render + kTraining).code == 0);
}

TEST_CASE("loberender: a cache of another revision of the lobe is stale") {
  const SceneFolder folder(true);
  const fs::path path = folder.caches().front();
  std::vector<std::byte> bytes;
  {
    const LobeCache cache = LobeCache::open(path);
    LobeCacheInfo info = cache.info();
    ++info.modelRevision;
    std::vector<std::uint32_t> lookup;
    for (std::uint32_t i = 0; i < info.gridCount; ++i) lookup.push_back(cache.lookup(i));
    bytes = encodeLobeCache(info, cache.records(), cache.components(), lookup);
  }
  writeAtomically(path, std::span<const std::byte>(bytes));
  const std::string line = fault(folder, kRender, 1);
  CHECK_THAT(line, Catch::Contains(path.filename().string() + ": stale") && Catch::Contains("run: lobefit"));
  CHECK(folder.run(kQuickFit).code == 0);
  CHECK(folder.run(kRender).code == 0);
}

TEST_CASE("loberender: errors explain why a cache is invalid") {
  const SceneFolder folder(true);
  const fs::path path = folder.caches().front();
  const std::string whole = readFile(path);
  const auto flipped = [&](std::size_t offset, int bit) {
    std::string bytes = whole;
    bytes[offset] = static_cast<char>(bytes[offset] ^ (1 << bit));
    return bytes;
  };
  std::string newer = whole;
  newer[8] = 99;
  const std::vector<std::pair<std::string, std::string>> cases{{whole.substr(0, whole.size() / 2), "truncated"},
                                                               {whole.substr(0, 10), "truncated"},
                                                               {flipped(whole.size() / 2, 3), "damaged"},
                                                               {flipped(24, 0), "damaged"},
                                                               {newer, "version"},
                                                               {"", "empty"},
                                                               {std::string(1000, 'x'), "not a"}};
  for (const auto& [bytes, word] : cases) {
    writeAtomically(path, bytes);
    CHECK_THAT(fault(folder, kRender, 1), Catch::Contains(path.filename().string()) && Catch::Contains(word));
  }
  CHECK(folder.run(kQuickFit).code == 0);
  CHECK(folder.run(kRender).code == 0);
}

TEST_CASE("loberender: errors in a scene give file and line and column") {
  const SceneFolder folder(false);
  const auto lineOf = [&](const std::string& scene) {
    folder.write("bad.xml", "<scene version='0.6.0'><sensor type='perspective'/>\n" + scene + "\n</scene>");
    return fault(folder, "loberender bad.xml -o a.exr --spp 1", 1);
  };
  CHECK_THAT(lineOf("<bsdf type='diffuse'>"), Catch::Contains("bad.xml:3:3: broken XML"));
  CHECK_THAT(lineOf("<shape type='obj'><string name='filename' value='gone.obj'/></shape>"),
             Catch::Contains("bad.xml:2:") && Catch::Contains("gone.obj"));
  CHECK_THAT(lineOf("<bsdf type='diffuse' id='a'><texture type='bitmap' name='reflectance'>"
                    "<string name='filename' value='gone.png'/></texture></bsdf>"),
             Catch::Contains("bad.xml:2:") && Catch::Contains("gone.png"));
  CHECK_THAT(fault(folder, "loberender gone.xml -o a.exr --spp 1", 1), Catch::Contains("gone.xml"));
}

TEST_CASE("loberender: invalid command lines are errors") {
  const SceneFolder folder(false);
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "--spp"},
      {" --spp 1 --seconds 1", "--spp"},
      {" --spp 0", "--spp"},
      {" --spp -3", "--spp"},
      {" --spp many", "--spp"},
      {" --seconds 0", "--seconds"},
      {" --seconds nan", "--seconds"},
      {" --seconds inf", "--seconds"},
      {" --spp 1 --size 16", "--size"},
      {" --spp 1 --size 0x12", "--size"},
      {" --spp 1 --size 16x12x3", "--size"},
      {" --spp 1 --size 1000000x1000000", "--size"},
      {" --spp 1 --size 4294967297x1", "--size"},
      {" --spp 1 --size 65537x1", "at most 268435456 pixels, and 65536 on a side"},
      {" --spp 1 --size 1x65537", "at most 268435456 pixels, and 65536 on a side"},
      {" --spp 1 --size 16x", "--size"},
      {" --spp 1 --max-depth 0", "--max-depth"},
      {" --spp 1 --seed -1", "--seed"},
      {" --spp 1 --seed 18446744073709551616", "--seed"},
      {" --spp 1 --integrator 1", "auto, path, bdpt, vcm, guided, product"},
      {" --spp 1 --reference a.exr", "--convergence"},
      {" --spp 1 --convergence a.csv", "--reference"},
      {" --spp 1 --integrator magic", "--integrator"},
      {" --spp 1 --components 9", "components"},
      {" --spp 1 --passes -1", "passes"},
      {" --spp 1 --photons 0", "--photons"},
      {" --spp 1 --photons 2147483647", "100000000"},
      {" --spp 1 --importons 2147483647", "100000000"},
      {" --seconds 1 --train-seconds 1", "--train-seconds"},
      {" --spp 1 --passes 0", "--passes"},
      {" --spp 1 --threads 0", "--threads"},
      {" --spp 1 -o b.jpg", "b.jpg"},
      {" --spp 1 -o a.exr", "a.exr"},
      {" --spp 1 --stats scene.xml", "scene.xml"},
      {" --spp 1 --guide magic", "--guide"},
      {" --spp 1 --light-paths maybe", "auto, on, off"},
      {" --spp 1 --firefly-limit 0", "--firefly-limit"},
      {" --spp 1 --integrator vcm --merge-radius 0", "--merge-radius"},
      {" --spp 1 --integrator vcm --merge-alpha 1.5", "--merge-alpha"},
      {" --spp 1 --integrator vcm --save-illumination a.illum", "bdpt with --guide"},
      {" --spp 1 --gradients l3", "l2, l1"},
      {" --spp 1 --gradients l2 --integrator vcm",
       "--gradients requires --integrator auto, path, bdpt, guided or product"},
      {" --spp 1 --gradients l2 --sample-offset 1", "--gradients cannot be combined with --sample-offset"},
      {" --spp 1 --gradients l2 --firefly-limit 5", "--gradients cannot be combined with --firefly-limit"},
      {" --spp 1 --gradients l2 --checkpoint c", "--gradients cannot be combined with --checkpoint"},
      {" --spp 1 --unknown", "--unknown"}};
  for (const auto& [options, word] : cases)
    CHECK_THAT(fault(folder, "loberender scene.xml -o a.exr" + options, 2), Catch::Contains(word));
  fault(folder, "loberender", 2);
  fault(folder, "loberender scene.xml --spp 1", 2);
}

TEST_CASE("loberender: every -o takes one file") {
  const SceneFolder folder(false);
  const std::string help = folder.run("loberender --help").out;
  CHECK_THAT(help, Catch::Contains("-o,--output FILE  ") && Catch::Contains("(repeatable: one file each)"));
  CHECK(folder.run("loberender -o a.exr --output=b.png -o c.exr scene.xml --spp 1 --integrator path").code == 0);
  for (const char* name : {"a.exr", "b.png", "c.exr"}) CHECK(folder.has(name));
  CHECK_THAT(fault(folder, "loberender scene.xml --spp 1 --integrator path -o d.exr e.exr", 2),
             Catch::Contains("e.exr"));
}

TEST_CASE("loberender: output files that cannot be written are reported before rendering") {
  const SceneFolder folder(false);
  folder.write("reference.exr", "not read yet");
  // With this many samples a check after rendering would never be reached.
  const std::string render = "loberender scene.xml --integrator path --spp 1000000000";
  const auto refused = [&](const std::string& options) {
    CHECK_THAT(fault(folder, render + options, 1), Catch::Contains("cannot write"));
  };
  refused(" -o none/a.exr");
  refused(" -o a.exr -o none/a.png");
  refused(" -o scene.xml/a.exr");
  refused(" -o a.exr --stats none/stats.json");
  refused(" -o a.exr --stats .");
  refused(" -o a.exr --reference reference.exr --convergence none/a.csv");
}

TEST_CASE("loberender: a reference must be an image of the same size") {
  const SceneFolder folder(false);
  const std::string render = "loberender scene.xml --integrator path --spp 1";
  REQUIRE(folder.run(render + " --size 8x6 -o small.exr").code == 0);
  const std::string measured = render + " -o a.exr --convergence a.csv --reference ";
  CHECK_THAT(fault(folder, measured + "small.exr", 1),
             Catch::Contains("8x6") && Catch::Contains("16x12") && Catch::Contains("small.exr"));
  CHECK_THAT(fault(folder, measured + "gone.exr", 1), Catch::Contains("gone.exr"));
}

TEST_CASE("loberender: images do not depend on the number of threads and store their provenance") {
  const SceneFolder folder(true);
  const std::string chosen = "loberender scene.xml --spp 4 --seed 9" + kTraining;
  REQUIRE(folder.run(chosen + " --threads 1 -o one.exr").code == 0);
  REQUIRE(folder.run(chosen + " --threads 2 -o two.exr").code == 0);
  CHECK(folder.bytes("one.exr") == folder.bytes("two.exr"));

  const std::string render = "loberender scene.xml --spp 4 --seed 9 --integrator product" + kTraining;
  REQUIRE(folder.run(render + " --threads 1 -o one.exr").code == 0);
  REQUIRE(folder.run(render + " --threads 2 -o two.exr").code == 0);
  REQUIRE(folder.run(render + " --threads 2 -o again.exr").code == 0);
  CHECK(folder.bytes("one.exr").size() > 500);
  CHECK(folder.bytes("one.exr") == folder.bytes("two.exr"));
  CHECK(folder.bytes("two.exr") == folder.bytes("again.exr"));
  REQUIRE(folder.run(render + "1 -o other.exr").code == 0);  // more importons
  CHECK(folder.bytes("other.exr") != folder.bytes("one.exr"));

  const Imf::InputFile file((folder / "one.exr").c_str());
  CHECK(number(file.header(), "seed") == 9);
  CHECK(number(file.header(), "samples") == 4);
  CHECK(file.header().findTypedAttribute<Imf::DoubleAttribute>("seconds") == nullptr);
  const std::string hashes = file.header().typedAttribute<Imf::StringAttribute>("cacheHashes").value();
  CHECK(hashes.size() == 2 * 16 + 1);
  for (const fs::path& cache : folder.caches())
    CHECK_THAT(hashes, Catch::Contains(fmt::format("{:016x}", LobeCache::open(cache).hash())));
}

TEST_CASE("loberender: bidirectional pictures do not depend on the number of threads, guided or not") {
  const SceneFolder folder(true);
  const std::string guide = GENERATE("none", "illumination", "product");
  const std::string render = "loberender scene.xml --integrator bdpt --spp 4 --seed 9 --guide " + guide + kTraining;
  for (const std::string threads : {"1", "2", "7"})
    REQUIRE(folder.run(fmt::format("{0} --threads {1} -o {1}.exr --stats s.json", render, threads)).code == 0);
  CHECK(folder.bytes("1.exr") == folder.bytes("2.exr"));
  CHECK(folder.bytes("1.exr") == folder.bytes("7.exr"));
  const auto s = parseJson(folder.bytes("s.json"));
  CHECK(s.at("integrator") == "bdpt");
  CHECK((s.at("records") > 0) == (guide != "none"));
  CHECK(s.at("nonfinite_samples") == 0);
  CHECK(folder.run("loberender scene.xml --integrator path --spp 1 -o a.exr --guide product")
            .error.find("--integrator path ignores --guide") != std::string::npos);
  const std::string unused = folder
                                 .run(
                                     "loberender scene.xml --integrator bdpt --spp 1 -o a.png --shadow-surfaces 2 "
                                     "--aov albedo --exr-type half")
                                 .error;
  CHECK_THAT(unused, Catch::Contains("--integrator bdpt ignores --shadow-surfaces"));
  CHECK_THAT(unused, Catch::Contains("--aov has no effect") && Catch::Contains("--exr-type has no effect"));
}

TEST_CASE("loberender: notes say whether the integrator or --gradients ignores an option") {
  const SceneFolder folder(false);
  const std::string render =
      "loberender scene.xml --spp 1 -o a.exr --light-paths on --russian-roulette efficiency "
      "--filtering splatting" +
      kTraining + " --integrator ";
  ToolRun run = folder.run(render + "guided --gradients l2");
  CHECK(run.code == 0);
  CHECK_THAT(run.error, Catch::Contains("note: --gradients ignores --light-paths, --russian-roulette, --filtering\n") &&
                            !Catch::Contains("--integrator"));
  run = folder.run(render + "path --gradients l2");
  CHECK(run.code == 0);
  CHECK_THAT(run.error, Catch::Contains("note: --integrator path ignores --passes") &&
                            Catch::Contains("--light-paths, --russian-roulette\n") &&
                            Catch::Contains("note: --gradients ignores --filtering\n"));
  run = folder.run(render + "guided");
  CHECK(run.code == 0);
  CHECK_THAT(run.error, !Catch::Contains("ignores"));
  run = folder.run(
      "loberender scene.xml --spp 1 -o a.exr --integrator guided --gradients l2 --filtering importance "
      "--light-paths off --russian-roulette throughput" +
      kTraining);
  CHECK(run.code == 0);
  CHECK_THAT(run.error, !Catch::Contains("ignores"));
}

TEST_CASE("loberender: pictures from gradients do not depend on the number of threads and are not negative") {
  const SceneFolder folder(true);
  const std::string integrator = GENERATE("path", "guided", "product", "bdpt", "bdpt --guide product");
  const std::string norm = GENERATE("l2", "l1");
  const std::string render =
      "loberender scene.xml --spp 4 --seed 9 --integrator " + integrator + " --gradients " + norm + kTraining;
  for (const std::string threads : {"1", "2", "7"})
    REQUIRE(folder.run(fmt::format("{0} --threads {1} -o {1}.exr", render, threads)).code == 0);
  CHECK(folder.bytes("1.exr") == folder.bytes("2.exr"));
  CHECK(folder.bytes("1.exr") == folder.bytes("7.exr"));
  for (const Rgb& pixel : readImage(folder / "1.exr").pixels) CHECK(pixel.minCoeff() >= 0);
  const Imf::InputFile file((folder / "1.exr").c_str());
  CHECK(file.header().typedAttribute<Imf::StringAttribute>("gradients").value().substr(0, 2) == norm);
  CHECK(number(file.header(), "clampedFraction") >= 0);
  CHECK(number(file.header(), "clampedFraction") < 0.1);
}

TEST_CASE("loberender: pictures with light paths do not depend on the number of threads, and parts make the whole") {
  const SceneFolder folder(true);
  const std::string integrator = GENERATE("guided", "product");
  const std::string render = "loberender scene.xml --light-paths on --seed 9 --integrator " + integrator + kTraining;
  for (const std::string threads : {"1", "2", "7"})
    REQUIRE(folder.run(fmt::format("{0} --spp 4 --stats s.json --threads {1} -o {1}.exr", render, threads)).code == 0);
  CHECK(folder.bytes("1.exr") == folder.bytes("2.exr"));
  CHECK(folder.bytes("1.exr") == folder.bytes("7.exr"));
  const auto s = parseJson(folder.bytes("s.json"));
  CHECK(s.at("integrator") == integrator);
  CHECK(s.at("light_paths").at("used") == true);
  CHECK(s.at("light_paths").at("paths_per_pixel") > 0);
  CHECK(s.at("nonfinite_samples") == 0);
  const auto& largest = s.at("largest_contributions");
  REQUIRE(largest.size() > 10);
  CHECK(largest[0].at("luminance") >= largest[1].at("luminance"));
  CHECK(std::ranges::any_of(largest, [](const auto& c) { return c.at("technique") == "next_event"; }));

  REQUIRE(folder.run(render + " --spp 2 -o a.exr").code == 0);
  REQUIRE(folder.run(render + " --spp 2 --sample-offset 2 -o b.exr").code == 0);
  REQUIRE(runBinary(folder.path(), "lobecompare --merge merged.exr a.exr b.exr").code == 0);
  const Image whole = readImage(folder / "1.exr"), merged = readImage(folder / "merged.exr");
  for (std::size_t i = 0; i < whole.pixels.size(); ++i)
    CHECK((whole.pixels[i] - merged.pixels[i]).abs().maxCoeff() < 1e-5f * (1 + whole.pixels[i].maxCoeff()));
  CHECK(folder.run("loberender scene.xml --integrator path --spp 1 -o a.exr --light-paths on")
            .error.find("--integrator path ignores --light-paths") != std::string::npos);
}

TEST_CASE("loberender: pictures say how much light --firefly-limit has cut off, and so do merged ones") {
  const SceneFolder folder(true);
  const std::string integrator =
      GENERATE("path", "path --filtering importance", "product --light-paths on", "bdpt", "vcm");
  const bool trained = integrator.starts_with("product");
  const std::string render =
      "loberender scene.xml --seed 3 --integrator " + integrator + (trained ? kTraining : std::string());
  const auto cutOf = [&](const std::string& name) {
    return std::get<double>(readAttributes(folder / name).at("fireflyCut"));
  };
  const auto sumOf = [&](const std::string& name) {
    double sum = 0;
    for (const Rgb& pixel : readImage(folder / name).pixels) sum += luminance(pixel);
    return sum;
  };
  REQUIRE(folder.run(render + " --spp 4 -o plain.exr").code == 0);
  CHECK(readAttributes(folder / "plain.exr").count("fireflyCut") == 0);
  const std::string limited = render + " --firefly-limit 0.05";
  REQUIRE(folder.run(limited + " --spp 4 -o whole.exr --stats s.json").code == 0);
  CHECK(std::get<double>(readAttributes(folder / "whole.exr").at("fireflyLimit")) == Approx(0.05));
  CHECK(cutOf("whole.exr") > 0.01);
  CHECK(parseJson(folder.bytes("s.json")).at("firefly_cut_fraction") == cutOf("whole.exr"));
  // The filter spreads samples over the border of the picture.
  CHECK(sumOf("whole.exr") / (1 - cutOf("whole.exr")) ==
        Approx(sumOf("plain.exr")).epsilon(integrator.ends_with("importance") ? 1e-4 : 0.02));

  REQUIRE(folder.run(limited + " --spp 1 -o a.exr").code == 0);
  REQUIRE(folder.run(limited + " --spp 3 --sample-offset 1 -o b.exr").code == 0);
  REQUIRE(runBinary(folder.path(), "lobecompare --merge merged.exr a.exr b.exr").code == 0);
  CHECK(cutOf("merged.exr") == Approx(cutOf("whole.exr")).epsilon(1e-4));
}

TEST_CASE("loberender: auto compares integrators in the course of a training of its own length") {
  const SceneFolder folder(true);
  const auto statistics = [&](const std::string& options) {
    REQUIRE(folder.run("loberender scene.xml --seconds 1 -o a.exr --stats s.json" + options).code == 0);
    return nlohmann::json::parse(folder.bytes("s.json"));
  };
  const auto early = statistics("");
  CHECK(early.at("pilot").at("path").at("variance") > 0);
  CHECK(early.at("pilot").at("product").at("variance") > 0);
  // Only the comparison needs the counts if path is chosen.
  CHECK((early.at("seconds_sample_counts") == 0) == (early.at("integrator") == "path"));
  CHECK(early.at("nonfinite_samples") == 0);
  const auto limited = statistics(" --passes 1 --photons 3000 --importons 2000");
  CHECK(limited.at("training_passes").size() == 1);
  CHECK(limited.at("training_passes")[0].at("log_likelihood").is_null());  // there were no records before
  CHECK(limited.at("pilot").at("path").at("variance") > 0);
}

TEST_CASE("loberender: statistics and convergence and images of a run") {
  const SceneFolder folder(true);
  REQUIRE(folder.run("loberender scene.xml --integrator path --spp 8 --seed 2 -o reference.exr").code == 0);
  const std::set<std::string> before = folder.names();
  const ToolRun run = folder.run(
      "loberender scene.xml --seconds 0.5 -o a.exr -o a.png --stats s.json --reference reference.exr --convergence "
      "c.csv" +
      kTraining);
  CAPTURE(run.error);
  REQUIRE(run.code == 0);

  SECTION("nothing else is written") {
    std::set<std::string> expected = before;
    expected.insert({"a.exr", "a.png", "s.json", "c.csv"});
    CHECK(folder.names() == expected);
  }
  SECTION("statistics") {
    const auto s = parseJson(folder.bytes("s.json"));
    const double training = s.at("seconds_training"), rendering = s.at("seconds_rendering");
    const auto result = [&](const char* name) {
      const auto& one = s.at("pilot").at(name);
      return PilotResult{one.at("variance"), one.at("cost")};
    };
    const PilotComparison pilot = compared(result("path"), result("product"), true);
    CHECK(s.at("integrator") == (pilot.prefersProduct() ? "product" : "path"));
    CHECK(training > 0);
    CHECK(rendering > 0);
    const double preparing = s.at("seconds_learning_lights").get<double>() +
                             s.at("seconds_sample_counts").get<double>() + s.at("pilot").at("seconds").get<double>() +
                             s.value("/light_paths/seconds"_json_pointer, 0.0);
    CHECK(s.at("seconds_total").get<double>() == Approx(training + preparing + rendering));
    CHECK(s.at("spp") >= 1);
    CHECK(s.at("rays") >= s.at("path_segments"));
    CHECK(s.at("path_segments") >= s.at("spp").get<int>() * 16 * 12);
    CHECK(s.at("segments_per_second").get<double>() == Approx(s.at("path_segments").get<double>() / rendering));
    CHECK(s.at("mean_path_length") >= 1);
    CHECK(s.at("peak_rss_bytes") > 1e6);
    CHECK(s.at("records") > 0);
    CHECK(s.at("record_bytes") > s.at("records"));
    std::uintmax_t lobes = 0;
    for (const fs::path& cache : folder.caches()) lobes += fs::file_size(cache);
    CHECK(s.at("lobe_bytes") == lobes);
    CHECK(s.at("version").get<std::string>() == LOBE_VERSION);
    const Imf::InputFile picture((folder / "a.exr").c_str());
    CHECK(s.at("scene_hash").get<std::string>() ==
          picture.header().typedAttribute<Imf::StringAttribute>("sceneHash").value());
    std::set<std::string> hashes;
    for (const fs::path& cache : folder.caches()) hashes.insert(fmt::format("{:016x}", LobeCache::open(cache).hash()));
    CHECK(s.at("cache_hashes").get<std::set<std::string>>() == hashes);
    CHECK(s.at("nonfinite_samples") == 0);
    double sum = 0;
    for (const auto& fraction : s.at("strategy_fractions")) sum += fraction.get<double>();
    CHECK(sum == Approx(1));
  }
  SECTION("convergence") {
    std::istringstream csv(folder.bytes("c.csv"));
    std::string line;
    std::getline(csv, line);
    CHECK(line == "seconds,spp,mse,relmse,relmse_drop_0.1pct,relmse_drop_1pct,mean_ratio");
    double seconds = 0;
    int samples = 0, lines = 0;
    while (std::getline(csv, line)) {
      double s = 0, mse = 0;
      int n = 0;
      REQUIRE(std::sscanf(line.c_str(), "%lf,%d,%lf", &s, &n, &mse) == 3);
      CHECK((s >= seconds && n > samples && mse > 0));
      seconds = s;
      samples = n;
      ++lines;
    }
    CHECK(lines >= 1);
    CHECK(seconds > 0);
  }
  SECTION("images") {
    const Image exr = readImage(folder / "a.exr"), png = readImage(folder / "a.png");
    CHECK((png.width == 16 && png.height == 12));
    double difference = 0;
    for (std::size_t i = 0; i < exr.pixels.size(); ++i)
      difference = std::max<double>(difference, (exr.pixels[i].min(1.0f) - png.pixels[i]).abs().maxCoeff());
    CHECK(difference < 0.01);
    const Imf::InputFile file((folder / "a.exr").c_str());
    CHECK(number(file.header(), "seconds") > 0);
    CHECK(number(file.header(), "samples") >= 1);
  }
}

TEST_CASE("loberender: --record plots the record used at a pixel") {
  const SceneFolder folder(false);
  const std::string guided = "loberender scene.xml -o a.exr --spp 1 --integrator guided" + kTraining;
  const ToolRun run = folder.run(guided + " --record 8,11 --record-image floor.png");
  CAPTURE(run.error);
  REQUIRE(run.code == 0);
  CHECK_THAT(run.error, Catch::Contains("floor.png: position ") && Catch::Contains("NEV "));
  const Image image = readImage(folder / "floor.png");
  CHECK((image.width == 3 * 248 + 8 && image.height > 248 + 4 * 14));  // panels, scales and text
  // None of the three panels is empty.
  for (const int column : {0, 1, 2}) {
    std::set<float> greens;
    for (int y = 0; y < image.height; ++y)
      for (int x = column * image.width / 3; x < (column + 1) * image.width / 3; ++x) greens.insert(image.at(x, y).y());
    CHECK(greens.size() > 5);
  }
  CHECK(folder.run(guided + " --record 8,11 --record-image floor.PNG").code == 0);
  CHECK(folder.run(guided + " --record 8,11").code == 0);
  CHECK(folder.has("record.png"));
}

TEST_CASE("loberender: --record reports why no record can be plotted") {
  const SceneFolder folder(false);
  const std::string guided = "loberender scene.xml -o a.exr --spp 1 --integrator guided" + kTraining;
  CHECK_THAT(fault(folder, guided + " --record 16,0", 1), Catch::Contains("--record 16,0: the image has 16x12 pixels"));
  CHECK_THAT(fault(folder, guided + " --record=-1,3", 1), Catch::Contains("--record -1,3: the image has"));
  CHECK_THAT(fault(folder, guided + " --record 0,0", 1), Catch::Contains("no surface that scatters light"));
  CHECK_THAT(fault(folder, guided + " --record 3", 2), Catch::Contains("'3' is not X,Y"));
  CHECK_THAT(fault(folder, guided + " --record 8,11 --record-image a.exr", 2),
             Catch::Contains("must name a .png file"));
  CHECK_THAT(fault(folder, guided + " --record-image a.png", 2), Catch::Contains("--record"));
  CHECK_THAT(fault(folder, "loberender scene.xml -o a.exr --spp 1 --integrator path --record 8,11", 2),
             Catch::Contains("requires --integrator auto, guided or product"));
  // Without light there are no records.
  std::string dark = kScene;
  const std::string radiance = "radiance\" value=\"";
  dark[dark.find(radiance) + radiance.size()] = '0';
  folder.write("scene.xml", dark);
  const ToolRun run = folder.run(guided + " --record 8,11");
  CHECK(run.code == 0);  // a missing record must not discard a finished rendering
  CHECK_THAT(run.error, Catch::Contains("no record serves the point"));
  CHECK(folder.has("a.exr"));
}
