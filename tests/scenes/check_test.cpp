// Files with several faults, files for older versions, and encodings: what is reported, and what is read nevertheless.

#include <functional>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "runtime/core/parallel.h"
#include "scenes/mitsuba/file_search.h"
#include "scenes/mitsuba/findings.h"
#include "tests/support/scenes_test_tools.h"

namespace lobe {
namespace {

SceneCheck check(const std::string& text, bool lenientReading = false) {
  const TestFolder folder;
  ReadOptions options;
  options.lenient = lenientReading;
  return checkScene(folder.write("test.xml", text), options);
}

/// A scene for an older renderer, which ignores unknown parameters.
std::string oldSceneOf(const std::string& body) {
  return "<scene version=\"0.6.0\">\n" + body + "\n" + kSensor + "\n</scene>\n";
}

Rgb albedoOf(const Scene& scene, std::size_t shape) {
  const int material = scene.shapes.at(shape).material;
  return scene.materials.at(static_cast<std::size_t>(material)).bsdf->albedo(Vec3::UnitZ(), Vec2(0.5f, 0.5f));
}

std::string utf16(const std::string& ascii, bool bigEndian, bool mark) {
  std::string bytes = !mark ? "" : bigEndian ? "\xfe\xff" : "\xff\xfe";
  for (const char c : ascii) bytes += bigEndian ? std::string{'\0', c} : std::string{c, '\0'};
  return bytes;
}

}  // namespace

TEST_CASE("scenes: all faults of a file are reported in one run and grouped by kind") {
  std::string body;
  for (int i = 0; i < 12; ++i) body += fmt::format("<shape type=\"torus{}\"/>\n", i);
  for (int i = 0; i < 5; ++i) body += "<shape type=\"knot\"/>\n";
  body += "<shape type=\"sphere\"><float name=\"radius\" value=\"-1\"/></shape>";
  const SceneCheck found = check(sceneOf(body));
  REQUIRE(found.faults.size() == 14);
  CHECK(found.faults[12].count == 5);
  CHECK_THAT(found.faults[12].where, Catch::EndsWith("test.xml:14:1"));
  CHECK_THAT(found.faults[13].text(), Catch::Contains("test.xml:19:22") && Catch::Contains("radius is ignored"));
  CHECK(!found.readable);
  const std::string message = faultOf(body);
  CHECK(std::ranges::count(message, '\n') == 10);  // ten faults, and a line that counts them
  CHECK_THAT(message, Catch::Contains("torus9") && !Catch::Contains("torus10\""));
  CHECK_THAT(message,
             Catch::EndsWith("18 faults of 14 kinds; --check shows the other 4; --lenient reads what can be read"));
}

TEST_CASE("scenes: lenient reading tolerates every fault that leaves something to draw") {
  const TestFolder folder;
  folder.write("broken.ply", "ply\nformat ascii 1.0\n");
  folder.write("broken.png", "not a picture");
  const std::vector<std::string> faults = {
      "<shape type=\"cube\"><bsdf type=\"roughplastic\"><float name=\"alpha\" value=\"x\"/></bsdf></shape>",
      "<shape type=\"cube\"><bsdf type=\"roughplastic\"><float name=\"alpha\" value=\"-1\"/></bsdf></shape>",
      "<shape type=\"ply\"><string name=\"filename\" value=\"broken.ply\"/></shape>",
      "<shape type=\"ply\"/>",
      "<shape/>",
      "<shape type=\"cube\"><ref id=\"nobody\"/></shape>",
      "<shape type=\"cube\"><float value=\"1\"/></shape>",
      "<shape type=\"cube\">text</shape>",
      "<shape type=\"cube\"><transform name=\"to_world\"><shear/></transform></shape>",
      "<shape type=\"cube\"><transform name=\"to_world\"><scale value=\"0\"/></transform></shape>",
      "<shape type=\"cube\"><bsdf type=\"diffuse\"/><bsdf type=\"diffuse\"/></shape>",
      "<shape type=\"cube\"><bsdf type=\"mask\"/></shape>",
      "<shape type=\"instance\"/>",
      "<shape type=\"shapegroup\" id=\"g\"><shape type=\"instance\"><ref id=\"g\"/></shape></shape>",
      "<bsdf type=\"mask\" id=\"a\"><ref id=\"b\"/></bsdf><bsdf type=\"mask\" id=\"b\"><ref id=\"a\"/></bsdf>",
      "<bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\"><string name=\"filename\" "
      "value=\"broken.png\"/></texture></bsdf>",
      "<emitter type=\"envmap\"><string name=\"filename\" value=\"broken.png\"/></emitter>",
      "<emitter type=\"sunsky\"><float name=\"sun_scale\" value=\"-1\"/></emitter>",
      "<emitter type=\"point\"><rgb name=\"intensity\" value=\"-1\"/></emitter>",
      "<emitter type=\"area\"/>",
      "<include filename=\"absent.xml\"/>",
      "<path value=\"absent\"/>",
      "<default name=\"a\"/>",
      "<alias id=\"nobody\" as=\"somebody\"/>",
      "<shape type=\"cube\" id=\"same\"/><shape type=\"cube\" id=\"same\"/>",
      "<shape type=\"cube\"><boolean name=\"flip_normals\" value=\"$undefined\"/></shape>",
      "<integrator type=\"path\"><integer name=\"max_depth\" value=\"deep\"/></integrator>",
      "<integrator type=\"ao\"/>",
      "<gizmo/>"};
  for (const std::string& fault : faults) {
    CAPTURE(fault);
    const auto path = folder.write("test.xml", sceneOf("<shape type=\"sphere\" id=\"Kept\"/>" + fault));
    CHECK_THROWS_AS(readScene(path), SceneError);
    const Scene scene = readScene(path, lenient());
    CHECK(!scene.warnings.empty());
    CHECK(scene.shapes.at(0).name == "Kept");
  }
}

TEST_CASE("scenes: lenient reading ignores a parameter that is out of range") {
  const auto alphaOf = [](const std::string& alpha) {
    const Scene scene = readBody(
        "<shape type=\"sphere\"><bsdf type=\"roughconductor\"><string name=\"distribution\" "
        "value=\"ggx\"/>" +
            alpha + "</bsdf></shape>",
        lenient());
    return scene.materials.at(0).bsdf->lobes()[0]->key();
  };
  CHECK(alphaOf("<float name=\"alpha\" value=\"-1\"/>") == alphaOf(""));
  CHECK(alphaOf("<float name=\"alpha\" value=\"0.4\"/>") != alphaOf(""));
  // The sky is read again without its invalid parameter, but added only once.
  const auto skyOf = [](const std::string& scale) {
    return readBody("<emitter type=\"sunsky\"><integer name=\"resolution\" value=\"16\"/>" + scale + "</emitter>",
                    lenient())
        .environment->radiance.at(3, 3)
        .x();
  };
  CHECK(skyOf("<float name=\"sun_scale\" value=\"-1\"/>") == skyOf(""));
}

TEST_CASE("scenes: lenient reading fails when nothing is left to draw or there is no sensor") {
  CHECK_THAT(faultOf("<shape type=\"torus\"/>", lenient()), Catch::Contains("torus"));
  CHECK_THAT(faultOfText("<scene version=\"3.0.0\"><shape type=\"sphere\"/></scene>", lenient()),
             Catch::Contains("no <sensor>") && !Catch::Contains("--lenient"));
}

TEST_CASE("scenes: checkScene reports whether a scene can be read and does not throw") {
  CHECK(check(sceneOf("<shape type=\"sphere\"/>")).readable);
  CHECK(!check(sceneOf("<shape type=\"sphere\"/><shape type=\"torus\"/>")).readable);
  CHECK(check(sceneOf("<shape type=\"sphere\"/><shape type=\"torus\"/>"), true).readable);
  const SceneCheck broken = check("<scene><shape</scene>");
  REQUIRE(broken.faults.size() == 1);
  CHECK(!broken.readable);
  CHECK(check(sceneOf("<integrator type=\"volpath\"/><shape type=\"sphere\"/>")).notes.size() == 1);
}

TEST_CASE("scenes: reading ends early in a cancelled task, also where it has no parallel loop") {
  const auto isCancelled = [](const std::function<void()>& work) {
    tbb::task_group_context context(tbb::task_group_context::isolated);
    tbb::task_group group(context);
    bool cancelled = false;
    group.run_and_wait([&] {
      context.cancel_group_execution();
      try {
        work();
      } catch (const LoopCancelled&) {
        cancelled = true;
      }
    });
    return cancelled;
  };
  ReadOptions materialsOnly;
  materialsOnly.geometry = false;
  CHECK(isCancelled([&] { readBody("<bsdf type=\"diffuse\"/>", materialsOnly); }));
  const TestFolder folder;
  CHECK(isCancelled([&] { FileSearch(folder.path()).find("a.png"); }));
}

TEST_CASE("scenes: unused parameters cause a warning in old files and a fault in new ones") {
  const std::string body =
      "<shape type=\"sphere\"><bsdf type=\"conductor\"><string name=\"material\" value=\"Al\"/>"
      "<float name=\"alpha\" value=\"0.1\"/></bsdf></shape>";
  const Scene scene = readText(oldSceneOf(body));
  REQUIRE(scene.warnings.size() == 1);
  CHECK_THAT(scene.warnings[0],
             Catch::Contains("test.xml:2:81") && Catch::Contains("\"alpha\"") && Catch::Contains("it is ignored"));
  CHECK_THAT(faultOf(body), Catch::Contains("\"alpha\"") && Catch::Contains("--lenient"));
}

TEST_CASE("scenes: the last value of a repeated parameter is used") {
  const std::string body =
      "<shape type=\"sphere\"><bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"0.2\"/>"
      "<float name=\"reflectance\" value=\"0.7\"/></bsdf></shape>";
  for (const std::string& text : {oldSceneOf(body), sceneOf(body)}) {
    const Scene scene = readText(text);
    CHECK(albedoOf(scene, 0).x() == Approx(0.7f));
    REQUIRE(scene.warnings.size() == 1);
    CHECK_THAT(scene.warnings[0], Catch::Contains("test.xml:2:82") && Catch::Contains("given twice"));
  }
}

TEST_CASE("scenes: a file whose name differs in case or slashes is found when it is the only one") {
  const TestFolder folder;
  std::filesystem::create_directory(folder.path() / "Parts");
  folder.write("Parts/Ball.xml", "<scene version=\"3.0.0\"><shape type=\"sphere\"/></scene>");
  const auto read = [&](const std::string& name) {
    return readScene(folder.write("test.xml", sceneOf("<include filename=\"" + name + "\"/>")));
  };
  for (const std::string name : {"parts/ball.xml", "Parts\\Ball.xml", "PARTS\\ball.XML"}) {
    const Scene scene = read(name);
    CHECK(scene.shapes.size() == 1);
    REQUIRE(scene.warnings.size() == 1);
    CHECK_THAT(scene.warnings[0], Catch::Contains("test.xml:2:1") && Catch::Contains("Parts/Ball.xml is used instead"));
  }
  CHECK(read("Parts/Ball.xml").warnings.empty());
  folder.write("Parts/BALL.xml", "<scene version=\"3.0.0\"/>");
  CHECK_THROWS_WITH(read("Parts/ball.xml"), Catch::Contains("no file"));
}

TEST_CASE("scenes: files are looked for in the last folder first, also if it is given twice") {
  const TestFolder folder;
  for (const std::string name : {"a", "b"}) {
    std::filesystem::create_directory(folder.path() / name);
    folder.write(name + "/part.xml", "<scene version=\"3.0.0\"><shape type=\"cube\" id=\"" + name + "\"/></scene>");
  }
  const auto nameIn = [&](const std::string& folders) {
    const std::string body = folders + "<include filename=\"part.xml\"/>";
    return readScene(folder.write("test.xml", sceneOf(body))).shapes.at(0).name;
  };
  const std::string a = "<path value=\"a\"/>", b = "<path value=\"b\"/>";
  CHECK(nameIn(a + b) == "b");
  CHECK(nameIn(a + b + a) == "a");
}

// Searching all entries of all folders for each name would take far longer than the time limit of a test.
TEST_CASE("scenes: many names of missing files and equal folders take little time") {
  const TestFolder folder;
  for (int i = 0; i < 1000; ++i) folder.write(fmt::format("{}.png", i), "");
  std::string body;
  for (int i = 0; i < 100; ++i) body += "<path value=\".\"/>";
  for (int i = 0; i < 2000; ++i)
    body += fmt::format(
        "<texture type=\"bitmap\" id=\"t{0}\"><string name=\"filename\" value=\"none{0}.png\"/></texture>", i);
  CHECK(checkScene(folder.write("test.xml", sceneOf(body))).faults.size() == 2000);
}

TEST_CASE("scenes: files are found after a folder has been listed because of a missing one") {
  const TestFolder folder;
  std::filesystem::create_directory(folder.path() / "a");
  std::filesystem::create_symlink("nowhere", folder.path() / "a/link.png");
  folder.write("a/Part.png", "");
  folder.write("own.png", "");
  FileSearch search(folder.path());
  REQUIRE(search.add(folder.path() / "a"));
  for (const std::string name : {"none.png", "other.png", "link.png"}) {
    CHECK(search.find(name).path == folder.path() / name);
    CHECK(search.find(name).wanted.empty());
  }
  CHECK(search.find("Part.png").path == folder.path() / "a/Part.png");
  CHECK(search.find("Part.png").wanted.empty());
  CHECK(search.find("part.PNG").path == folder.path() / "a/Part.png");
  CHECK(search.find("part.PNG").wanted == folder.path() / "a/part.PNG");
  CHECK(search.find("own.png").path == folder.path() / "own.png");
  CHECK(search.find(".").path == folder.path() / "a/.");
}

TEST_CASE("scenes: names that the file system refuses are faults like those of missing files") {
  const TestFolder folder;
  std::filesystem::create_symlink("loop", folder.path() / "loop");
  const std::string filename = "<string name=\"filename\" value=\"";
  const std::vector<std::pair<std::string, std::string>> elements = {
      {"<texture type=\"bitmap\" id=\"t\">" + filename, "\"/></texture>"},
      {"<emitter type=\"envmap\">" + filename, "\"/></emitter>"},
      {"<shape type=\"obj\">" + filename, "\"/></shape>"},
      {"<shape type=\"cube\"><bsdf type=\"merl\">" + filename, "\"/></bsdf></shape>"},
      {"<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" filename=\"", "\"/></bsdf>"},
      {"<include filename=\"", "\"/>"},
      {"<path value=\"", "\"/>"}};
  for (const std::string& name : {std::string("loop"), std::string("loop/file"), std::string(300, 'a')})
    for (const auto& [before, after] : elements) {
      const std::string body = before + name + after + "<shape type=\"torus\"/><shape type=\"sphere\"/>";
      CAPTURE(body);
      const auto path = folder.write("test.xml", sceneOf(body));
      const SceneCheck found = checkScene(path);
      REQUIRE(found.faults.size() == 2);
      for (const Fault& fault : found.faults) CHECK_THAT(fault.where, Catch::Contains("test.xml:2:"));
      CHECK_NOTHROW(readScene(path, lenient()));
    }
}

TEST_CASE("scenes: files in other encodings are read alone and included in each other") {
  const TestFolder folder;
  const std::string latin1 =
      "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<scene version=\"3.0.0\"><!-- Gr\xf6\xdf"
      "e --><shape type=\"sphere\" id=\"Gr\xfcn\"/>\n<include filename=\"part.xml\"/>" +
      std::string(kSensor) + "\n\xe4\n</scene>";
  const std::string part =
      "<scene version=\"3.0.0\">\n<shape type=\"cube\" id=\"Part\"/><shape type=\"torus\"/></scene>";
  for (const std::string& included : {part, "\xef\xbb\xbf" + part, utf16(part, false, true), utf16(part, true, true),
                                      utf16(part, false, false), utf16(part, true, false)}) {
    folder.write("part.xml", included);
    try {
      readScene(folder.write("main.xml", latin1));
      FAIL("the faults are not found");
    } catch (const SceneError& error) {
      REQUIRE(error.faults().size() == 2);
      CHECK_THAT(error.faults()[0].where, Catch::EndsWith("part.xml:2:31"));
      CHECK_THAT(error.faults()[1].where, Catch::EndsWith("main.xml:4:1"));
      CHECK_THAT(error.faults()[1].message, Catch::Contains("\xc3\xa4"));
    }
    const Scene scene = readScene(folder.path() / "main.xml", lenient());
    REQUIRE(scene.shapes.size() == 2);
    CHECK(scene.shapes[0].name == "Gr\xc3\xbcn");
    CHECK(scene.shapes[1].name == "Part");
  }
}

TEST_CASE("scenes: an unknown or violated encoding is a fault of the file") {
  CHECK_THAT(faultOfText("<?xml version='1.0' encoding='klingon'?><scene/>"),
             Catch::Contains("test.xml:1:1") && Catch::Contains("\"klingon\" is not known"));
  CHECK_THAT(faultOfText(std::string("\xff\xfe<\0s\0\x00\xd8", 8)), Catch::Contains("encoding UTF-16LE"));
}

TEST_CASE("scenes: small files that would expand exponentially are rejected") {
  const std::string sphere = "<shape type=\"sphere\"/>";
  std::string values = "<default name=\"a0\" value=\"0123456789\"/>";
  for (int i = 1; i < 40; ++i) values += fmt::format("<default name=\"a{}\" value=\"$a{}$a{}\"/>", i, i - 1, i - 1);
  CHECK_THAT(faultOf(values + sphere), Catch::Contains("a value is longer than 1048576 characters"));

  const auto chain = [&](const std::string& element, const std::string& type, const std::string& leaf, int references) {
    std::string body = fmt::format("<{} type=\"{}\" id=\"e0\"/>", element, leaf);
    for (int i = 1; i <= 30; ++i) {
      body += fmt::format("<{} type=\"{}\" id=\"e{}\">", element, type, i);
      for (int j = 0; j < references; ++j) body += fmt::format("<ref name=\"color{}\" id=\"e{}\"/>", j, i - 1);
      body += fmt::format("</{}>", element);
    }
    return body + sphere;
  };
  CHECK_THAT(faultOf(chain("bsdf", "blendbsdf", "diffuse", 2)), Catch::Contains("more than 1000 nested bsdfs"));
  CHECK_THAT(faultOf(chain("texture", "checkerboard", "checkerboard", 2)),
             Catch::Contains("more than 1000 nested textures"));
  CHECK(faultOf(chain("bsdf", "twosided", "diffuse", 1)).empty());

  // 32 times a BSDF with 63 textures: each alone is within the limit.
  std::string product = "<texture type=\"checkerboard\" id=\"t0\"/>";
  for (int i = 1; i <= 5; ++i)
    product += fmt::format(
        "<texture type=\"checkerboard\" id=\"t{0}\"><ref name=\"color0\" id=\"t{1}\"/><ref name=\"color1\" "
        "id=\"t{1}\"/></texture>",
        i, i - 1);
  product += "<bsdf type=\"diffuse\" id=\"b0\"><ref name=\"reflectance\" id=\"t5\"/></bsdf>";
  CHECK(faultOf(product + sphere).empty());
  for (int i = 1; i <= 5; ++i)
    product +=
        fmt::format("<bsdf type=\"blendbsdf\" id=\"b{0}\"><ref id=\"b{1}\"/><ref id=\"b{1}\"/></bsdf>", i, i - 1);
  CHECK_THAT(faultOf(product + sphere), Catch::Contains("more than 1000 nested bsdfs and textures"));

  std::string deep;
  for (int i = 0; i < 100000; ++i)
    deep += fmt::format("<bsdf type=\"twosided\" id=\"e{}\"><ref id=\"e{}\"/></bsdf>\n", i, i + 1);
  deep += "<bsdf type=\"diffuse\" id=\"e100000\"/>";
  CHECK_THAT(faultOf(deep + sphere), Catch::Contains("nested more than 100 deep"));

  const TestFolder folder;
  for (int i = 0; i < 40; ++i)
    folder.write(
        fmt::format("{}.xml", i),
        fmt::format("<scene version=\"3.0.0\"><include filename=\"{0}.xml\"/><include filename=\"{0}.xml\"/></scene>",
                    i + 1));
  folder.write("40.xml", "<scene version=\"3.0.0\"/>");
  CHECK_THROWS_WITH(readScene(folder.path() / "0.xml"), Catch::Contains("more than 1000 <include>s"));
}

// Reading the file for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: the file of a spectrum is read once") {
  const TestFolder folder;
  std::string lines;
  for (int i = 1; i <= 200000; ++i) lines += fmt::format("{} 0.5\n", i);
  folder.write("grey.spd", lines);
  std::string body;
  for (int i = 0; i < 50000; ++i)
    body += "<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" filename=\"grey.spd\"/></bsdf>";
  const SceneCheck found = checkScene(folder.write("test.xml", oldSceneOf(body)));
  CHECK(found.faults.empty());
  CHECK(found.readable);
}

// Copying the spectrum for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: the file of a spectrum is converted to a colour once") {
  const TestFolder folder;
  std::string lines;
  for (int i = 1; i <= 2000000; ++i) lines += fmt::format("{} 0.5\n", i);
  folder.write("grey.spd", lines);
  std::string body;
  for (int i = 0; i < 100000; ++i)
    body +=
        "<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" type=\"irregular\">"
        "<string name=\"filename\" value=\"grey.spd\"/></spectrum></bsdf>";
  const std::string shape =
      "<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" "
      "filename=\"grey.spd\"/></bsdf></shape>";
  const Scene scene = readScene(folder.write("test.xml", sceneOf(body + shape)));
  CHECK(albedoOf(scene, 0).isApprox(grey(0.5f), 1e-3f));
}

// Reading the file for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: a faulty file of a measured material is read once") {
  const TestFolder folder;
  folder.write("a_rgb.bsdf", std::string(40000000, 'a'));
  std::string body;
  for (int i = 0; i < 50000; ++i)
    body += fmt::format(
        "<shape type=\"sphere\"><bsdf type=\"measured\"><string name=\"filename\" value=\"a_rgb.bsdf\"/>"
        "<float name=\"unused\" value=\"{}\"/></bsdf></shape>",
        i);
  const SceneCheck found = checkScene(folder.write("test.xml", sceneOf(body)));
  REQUIRE(found.faults.size() == 1);
  CHECK(found.faults[0].count == 50000);
  CHECK_THAT(found.faults[0].message, Catch::Contains("a_rgb.bsdf: not a tensor file"));
}

// Counting the column of each fault from the start of the line would take far longer than the time limit of a test.
TEST_CASE("scenes: many faults in a single line take neither much time nor much memory") {
  const std::string comment = "<!--" + std::string(50000000, 'a') + "-->";
  std::string body = comment;
  for (int i = 0; i < 20000; ++i) body += fmt::format("<default name=\"a{:05}\" value=\"\xc3\xa4\"/>", i);
  for (int i = 0; i < 100000; ++i) body += "<bsdf type=\"$none\"/>";
  const SceneCheck found = check(sceneOf(body));
  REQUIRE(found.faults.size() == 1);
  CHECK(found.faults[0].count == 100000);
  // Each <default> has 34 characters, one of which has two bytes.
  const std::size_t column = comment.size() + 20000 * 34 + 1;
  CHECK_THAT(found.faults[0].text(), Catch::Contains(fmt::format("test.xml:2:{}: $none is not defined", column)));
  CHECK_THAT(found.faults[0].text(), Catch::Contains("defined are a00000, a00001, ") &&
                                         Catch::Contains(", a00009 and 19990 more") && !Catch::Contains("a00010"));
}

TEST_CASE("scenes: names and values of any length are shortened in messages") {
  CHECK(shortened("name", 4) == "name");
  CHECK(shortened("longer name", 6) == "longer...");
  CHECK(shortened("\xc3\xa4\xc3\xb6\xc3\xbc", 3) == "\xc3\xa4...");
  const std::string name(200000, 'a');
  std::string defaults;
  for (int i = 0; i < 3; ++i) defaults += fmt::format("<default name=\"{}{}\" value=\"1\"/>", name, i);
  CHECK(faultOf(defaults + "<bsdf type=\"$none\"/>").size() < 1000);
  CHECK_THAT(faultOf(defaults + "<bsdf type=\"$none\"/>"), Catch::Contains("aaa..., aaa"));
  const std::string parameter = "<float name=\"power\" value=\"1\"/>";
  for (const std::string& body :
       {"<integrator type=\"" + name + "\">" + parameter + "</integrator>", "<" + name + "/>",
        "<bsdf type=\"" + name + "\"/>", "<bsdf type=\"diffuse\"><ref id=\"" + name + "\"/></bsdf>",
        "<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"" + name + "\"/></bsdf>",
        "<bsdf type=\"diffuse\"><float name=\"" + name + "\" value=\"1\"/></bsdf>"}) {
    for (const std::string& text : {sceneOf(body), oldSceneOf(body)}) {
      const SceneCheck found = check(text);
      for (const Fault& fault : found.faults) CHECK(fault.text().size() < 10000);
      for (const std::string& line : found.warnings) CHECK(line.size() < 10000);
      for (const std::string& line : found.notes) CHECK(line.size() < 10000);
    }
  }
}

TEST_CASE("scenes: undefined names are of one kind although more names are defined after the first of them") {
  const SceneCheck found = check(sceneOf("<default name=\"a\" value=\"$none\"/><default name=\"b\" value=\"$none\"/>"));
  REQUIRE(found.faults.size() == 1);
  CHECK(found.faults[0].count == 2);
}

TEST_CASE("scenes: the number of kinds of faults is limited with a fault that names the limit") {
  std::string body;
  for (int i = 0; i < 10005; ++i) body += fmt::format("<shape type=\"torus{}\"/>\n", i);
  const SceneCheck found = check(sceneOf(body + "<shape type=\"torus1\"/><shape type=\"sphere\"/>"), true);
  CHECK(!found.readable);
  REQUIRE(found.faults.size() == 10001);
  CHECK(found.faults[1].count == 2);
  CHECK(found.faults.back().count == 5);
  CHECK_THAT(found.faults.back().text(),
             Catch::Contains("test.xml:10002:1: ") && Catch::Contains("at most 10000 kinds of faults"));
}

// Parsing the scene again after each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: many includes in a scene file are replaced in linear time") {
  constexpr std::size_t kIncludes = 400000;
  std::string body;
  for (std::size_t i = 0; i < kIncludes; ++i) body += "<include/>";
  const SceneCheck found = check(sceneOf(body));
  REQUIRE(found.faults.size() == 1);
  CHECK(found.faults[0].count == kIncludes);
  CHECK_THAT(found.faults[0].text(), Catch::Contains("test.xml:2:1: <include> needs a filename"));
}

TEST_CASE("scenes: the length of included files is limited in total, also of those that cannot be parsed") {
  const TestFolder folder;
  folder.write("broken.xml", std::string(1 << 20, '<'));
  std::string body;
  for (int i = 0; i < 300; ++i) body += "<include filename=\"broken.xml\"/>";
  CHECK_THROWS_WITH(readScene(folder.write("test.xml", sceneOf(body))),
                    Catch::Contains("the file with all included files is longer than 268435456 bytes"));
}

TEST_CASE("scenes: the number of folders is limited") {
  std::string body;
  for (int i = 0; i < 100; ++i) body += "<path value=\"/\"/>";
  CHECK(faultOf(body).empty());
  CHECK_THAT(faultOf(body + "<path value=\"/\"/>"), Catch::Contains("more than 100 <path>s"));
}

TEST_CASE("scenes: columns are counted in characters, also at the ends of long lines") {
  for (const int count : {0, 1, 4000, 100000}) {
    std::string line;
    for (int i = 0; i < count; ++i) line += "\xe2\x82\xac";
    CAPTURE(count);
    CHECK_THAT(faultOf("<!--" + line + "\n" + line + "--><gizmo/>"),
               Catch::StartsWith(fmt::format("test.xml:3:{}: ", count + 4)));
  }
}

// Searching all notes for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: notes are kept once each in their order, also if there are many") {
  constexpr int kNotes = 600000;
  Findings findings;
  for (int repetition = 0; repetition < 2; ++repetition)
    for (int i = 0; i < kNotes; ++i) {
      findings.note(fmt::format("note {:06}", i));
      findings.noteWithoutEffect(fmt::format("owner {}", i % 2), fmt::format("parameter {:06}", i));
    }
  const std::vector<std::string> notes = findings.notes();
  REQUIRE(notes.size() == kNotes + 1);
  CHECK(notes[0] == "note 000000");
  CHECK(notes[kNotes - 1] == "note 599999");
  CHECK_THAT(notes.back(), Catch::Contains(": parameter 000000, parameter 000002, ") &&
                               Catch::Contains(", parameter 599998 of owner 0; parameter 000001, ") &&
                               Catch::EndsWith(", parameter 599999 of owner 1"));
}

TEST_CASE("scenes: integrators set the maximum depth and the visibility of emitters") {
  const auto read = [](const std::string& version, const std::string& integrator) {
    return readText("<scene version=\"" + version + "\">" + integrator + kSensor + "</scene>");
  };
  CHECK(read("3.0.0", "<integrator type=\"path\"><integer name=\"max_depth\" value=\"0\"/></integrator>").maxDepth ==
        0);
  CHECK(read("3.0.0", "<integrator type=\"direct\"/>").maxDepth == 2);
  CHECK(read("3.0.0", "<integrator type=\"path\"/>").emitterVisibility == EmitterVisibility::shown);
  const std::string hide = "<integrator type=\"path\"><boolean name=\"hideEmitters\" value=\"true\"/></integrator>";
  CHECK(read("3.0.0", hide).emitterVisibility == EmitterVisibility::hidden);
  CHECK(read("0.6.0", hide).emitterVisibility == EmitterVisibility::dark);
}

TEST_CASE("scenes: clip planes are read and must be in order") {
  const auto cameraOf = [](const std::string& planes) {
    return readText("<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/>" +
                    planes + "</sensor></scene>")
        .camera;
  };
  const Camera camera = cameraOf("<float name=\"nearClip\" value=\"0.5\"/><float name=\"farClip\" value=\"7\"/>");
  CHECK(camera.nearClip == 0.5f);
  CHECK(camera.farClip == 7.0f);
  CHECK(std::isinf(cameraOf("").farClip));
  CHECK_THROWS_WITH(cameraOf("<float name=\"nearClip\" value=\"-1\"/>"), Catch::Contains("near_clip"));
  CHECK_THROWS_WITH(cameraOf("<float name=\"nearClip\" value=\"3\"/><float name=\"farClip\" value=\"2\"/>"),
                    Catch::Contains("far_clip"));
}

TEST_CASE("scenes: consequences of a fault are not reported as further faults") {
  const auto faults = [](const std::string& body) { return check(sceneOf(body + "<shape type=\"cube\"/>")).faults; };
  CHECK(faults("<shape type=\"instance\"><ref id=\"nobody\"/></shape>").size() == 1);
  CHECK(faults("<bsdf type=\"mask\"><ref id=\"nobody\"/></bsdf>").size() == 1);
  CHECK(faults("<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"$undefined\"/></bsdf>").size() == 1);
  CHECK(faults("<bsdf type=\"mask\"/>").size() == 1);
  CHECK(faults("<shape type=\"ply\"><string name=\"filename\" value=\"$undefined\"/></shape>").size() == 1);
}

TEST_CASE("scenes: a fault is counted once although files are included after it") {
  const TestFolder folder;
  folder.write("part.xml", "<scene version=\"3.0.0\"/>");
  const std::string include = "<include filename=\"part.xml\"/>";
  const SceneCheck found =
      checkScene(folder.write("test.xml", sceneOf("<default name=\"a\"/>" + include + include + include)));
  REQUIRE(found.faults.size() == 1);
  CHECK(found.faults[0].count == 1);
}

TEST_CASE("scenes: unknown parameters of known integrators are faults and the first integrator is used") {
  CHECK_THAT(faultOf("<integrator type=\"path\"><integer name=\"max_dpeth\" value=\"3\"/></integrator>"),
             Catch::Contains("did you mean max_depth?") && Catch::Contains("--lenient"));
  CHECK(faultOf("<integrator type=\"guided_path\"><integer name=\"budget\" value=\"3\"/></integrator>").empty());
  const Scene scene = readBody(
      "<integrator type=\"path\"><integer name=\"max_depth\" value=\"3\"/></integrator><integrator type=\"path\"/>");
  CHECK(scene.maxDepth == 3);
  const Scene loose =
      readBody("<integrator type=\"path\"><boolean name=\"strict_normals\" value=\"false\"/></integrator>");
  REQUIRE(loose.warnings.size() == 1);
  CHECK_THAT(loose.warnings[0], Catch::Contains("strict normals are always on"));
}

TEST_CASE("scenes: a saturated reflectance spectrum with values up to 1 has no component over 1") {
  const auto colour = [](const std::string& points) {
    return albedoOf(readBody("<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"" +
                             points + "\"/></bsdf></shape>"),
                    0);
  };
  const Rgb red = colour("360:0, 549:0, 550:1, 830:1");
  CHECK(red.x() == 1.0f);
  CHECK(red.y() == Approx(0.368).epsilon(0.02));
  CHECK(colour("360:2, 830:2").x() == Approx(2.0f).epsilon(1e-3));
}

TEST_CASE("scenes: lenient reading reports when nothing is left") {
  CHECK_THAT(faultOf("<shape type=\"torus\"/>", lenient()), Catch::Contains("nothing is left to draw"));
}

}  // namespace lobe
