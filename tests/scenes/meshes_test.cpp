// Mesh parameters of scene files, and the material libraries of OBJ files.

#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "scenes/mitsuba/reader_shapes.h"
#include "tests/support/scenes_test_tools.h"

using namespace lobe;
using Catch::Matchers::Contains;

namespace {

const Vec3 kUp = Vec3::UnitZ();

/// Groups: unit squares, each with a material of its own, one of which is not in the library.
const std::string kSquares =
    "mtllib colours.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.25 0.25\n"
    "g left\nusemtl red\nf 1/1 2/1 3/1 4/1\ng right\nusemtl green\nf 1/1 2/1 3/1 4/1\nusemtl unknown\nf 1/1 2/1 3/1\n";
const std::string kRedAndGreen = "newmtl red\nKd 1 0 0\nillum 1\nnewmtl green\nKd 0 0.5 0\n";

std::string sceneOfObj(const std::string& content, const std::string& version = "0.6.0") {
  return "<scene version=\"" + version + "\">\n<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/>" +
         content + "</shape>\n" + kSensor + "\n</scene>\n";
}

class ObjScene {
 public:
  explicit ObjScene(const std::string& library, const std::string& obj = kSquares) {
    folder.write("a.obj", obj);
    if (!library.empty()) folder.write("colours.mtl", library);
  }
  Scene read(const std::string& content = "", const std::string& version = "0.6.0") const {
    return readScene(folder.write("test.xml", sceneOfObj(content, version)));
  }

  TestFolder folder;
};

const Bsdf& bsdfOf(const Scene& scene, std::size_t shape) {
  return *scene.materials.at(static_cast<std::size_t>(scene.shapes.at(shape).material)).bsdf;
}

Rgb albedoOf(const Scene& scene, std::size_t shape) {
  return bsdfOf(scene, shape).albedo(kUp, Vec2(0.25f, 0.25f));
}

/// The BSDF of an MTL material that is assigned to the first of the squares.
BsdfPtr bsdfOfMtl(const std::string& statements) {
  const Scene scene = ObjScene("newmtl red\n" + statements).read();
  return scene.materials.at(static_cast<std::size_t>(scene.shapes.at(0).material)).bsdf;
}

bool isNear(const Rgb& a, const Rgb& b, float tolerance = 1e-5f) {
  return (a - b).abs().maxCoeff() <= tolerance;
}

struct ReadShapes {
  Scene scene;
  std::vector<Fault> faults;
};

/// Reads the shapes of a scene whose meshes may have 20 triangles and vertices for each byte of their files, also if
/// that are few.
ReadShapes readShapes(const std::filesystem::path& path) {
  Findings findings;
  const SceneFile file(path, {}, findings);
  const ReadOptions options = {};
  ReadShapes read;
  ReadContext context(file, options, read.scene, findings);
  TextureReader textures(context);
  MaterialReader materials(context, textures);
  ShapeReader shapes(context, textures, materials, 0);
  for (const pugi::xml_node node : file.scene().children("shape")) shapes.add(node);
  shapes.readMeshes();
  read.faults = findings.faults();
  return read;
}

std::string repeated(int times, const std::string& text) {
  std::string result;
  for (int i = 0; i < times; ++i) result += text;
  return result;
}

/// A BMP with a single pixel.
std::string onePixel(unsigned char red, unsigned char green, unsigned char blue) {
  std::string bytes("BM\x3a\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\1\0\0\0\1\0\0\0\1\0\x18\0\0\0\0\0\4\0\0\0", 38);
  bytes += std::string(16, '\0');
  for (const unsigned char c : {blue, green, red}) bytes += static_cast<char>(c);
  return bytes + '\0';
}

}  // namespace

TEST_CASE("scenes: an OBJ in an older file has the materials of its library") {
  const Scene scene = ObjScene(kRedAndGreen).read();
  REQUIRE(scene.shapes.size() == 3);
  CHECK(scene.shapes[0].name == "a.obj:red");
  CHECK(isNear(albedoOf(scene, 0), Rgb(1, 0, 0)));
  // Colours are sRGB-encoded, as in Mitsuba 0.6.
  CHECK(isNear(albedoOf(scene, 1), Rgb(0, static_cast<float>(std::pow((0.5 + 0.055) / 1.055, 2.4)), 0)));
  CHECK(isNear(albedoOf(scene, 2), grey(0.5f)));
  CHECK(scene.warnings.empty());
  CHECK(scene.notes.empty());
}

TEST_CASE("scenes: the library of an OBJ is ignored where the scene gives materials") {
  const ObjScene files(kRedAndGreen);
  const std::string grey3 = "type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.3\"/></bsdf>";
  const Scene whole = files.read("<bsdf " + grey3);
  REQUIRE(whole.shapes.size() == 1);
  CHECK(isNear(albedoOf(whole, 0), grey(0.3f)));
  const Scene named = files.read("<bsdf name=\"green\" " + grey3);
  REQUIRE(named.shapes.size() == 3);
  CHECK(named.shapes[0].name == "a.obj:green");
  CHECK(isNear(albedoOf(named, 0), grey(0.3f)));
  CHECK(isNear(albedoOf(named, 1), Rgb(1, 0, 0)));
  CHECK(files.read("<boolean name=\"loadMaterials\" value=\"false\"/>").shapes.size() == 1);
  CHECK(files.read("", "3.0.0").shapes.size() == 1);
  CHECK(files.read("<boolean name=\"load_materials\" value=\"true\"/>", "3.0.0").shapes.size() == 3);
}

TEST_CASE("scenes: the only BSDF of an OBJ is that of all faces in new files, unless its name is that of a material") {
  const ObjScene files(kRedAndGreen);
  const auto bsdf = [](const std::string& name) {
    return "<bsdf name=\"" + name + "\" type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.3\"/></bsdf>";
  };
  for (const std::string version : {"2.0.0", "3.0.0"}) {
    const Scene whole = files.read(bsdf("material"), version);
    REQUIRE(whole.shapes.size() == 1);
    CHECK(whole.materials.size() == 1);
    CHECK(isNear(albedoOf(whole, 0), grey(0.3f)));
    CHECK(std::get<TriangleMesh>(whole.shapes[0].geometry).triangles.size() == 5);
    CHECK(whole.notes.empty());
    const Scene part = files.read(bsdf("green"), version);
    REQUIRE(part.shapes.size() == 2);
    CHECK(isNear(albedoOf(part, 0), grey(0.3f)));
    CHECK(isNear(albedoOf(part, 1), grey(0.5f)));
    const Scene several = files.read(bsdf("green") + bsdf("material"), version);
    REQUIRE(several.shapes.size() == 2);
    CHECK(isNear(albedoOf(several, 1), grey(0.5f)));
    CHECK(several.notes.size() == 1);
  }
  const Scene old = files.read(bsdf("material") + "<boolean name=\"loadMaterials\" value=\"false\"/>");
  REQUIRE(old.shapes.size() == 1);
  CHECK(isNear(albedoOf(old, 0), grey(0.5f)));
}

TEST_CASE("scenes: the last material of a name in a library is used") {
  const Scene scene = ObjScene(kRedAndGreen + "newmtl red\nKd 0 0 1\n").read();
  CHECK(isNear(albedoOf(scene, 0), Rgb(0, 0, 1)));
}

// Searching the library for each material would take far longer than the time limit of a test.
TEST_CASE("scenes: many materials are looked up in a large library in less than quadratic time") {
  constexpr int kMaterials = 400000;
  std::string library, obj = "mtllib colours.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < kMaterials; ++i) {
    library += fmt::format("newmtl known {}\n", i);
    obj += fmt::format("usemtl other {}\nf 1 2 3\n", i);
  }
  const ObjScene files(library, obj + "usemtl known 0\nf 1 2 3\n");
  const Scene scene = files.read();
  REQUIRE(scene.shapes.size() == 2);
  CHECK(scene.shapes[0].name == "a.obj:known 0");
  CHECK(std::get<TriangleMesh>(scene.shapes[1].geometry).triangles.size() == kMaterials);
}

TEST_CASE("scenes: shape_index selects a mesh of an OBJ") {
  const ObjScene files(kRedAndGreen);
  const auto indexed = [](int index) { return fmt::format("<integer name=\"shapeIndex\" value=\"{}\"/>", index); };
  for (const auto& [index, colour] : {std::pair(0, Rgb(1, 0, 0)), std::pair(2, grey(0.5f))}) {
    const Scene scene = files.read(indexed(index));
    REQUIRE(scene.shapes.size() == 1);
    CHECK(isNear(albedoOf(scene, 0), colour));
    CHECK(std::get<TriangleMesh>(scene.shapes[0].geometry).triangles.size() == (index == 0 ? 2 : 1));
  }
  CHECK(files.read(indexed(-1)).shapes.size() == 3);
  CHECK_THAT(faultOfText(sceneOfObj(indexed(-2))), Contains("test.xml:2:58: ") && Contains("shape_index"));
  CHECK_THROWS_WITH(files.read(indexed(3)), Contains("there is no mesh 3"));
}

TEST_CASE("scenes: a collapsed OBJ has the material of its last usemtl") {
  const ObjScene files(kRedAndGreen + "newmtl unknown\nKd 0 0 1\n");
  const Scene scene = files.read("<boolean name=\"collapse\" value=\"true\"/>");
  REQUIRE(scene.shapes.size() == 1);
  CHECK(isNear(albedoOf(scene, 0), Rgb(0, 0, 1)));
  CHECK(std::get<TriangleMesh>(scene.shapes[0].geometry).triangles.size() == 5);
}

TEST_CASE("scenes: illumination models of an MTL are converted to BSDFs as in Mitsuba 0.6") {
  const Vec3 wi = Vec3(0.3f, 0.2f, 0.8f).normalized();
  const Vec3 mirrored(-wi.x(), -wi.y(), wi.z());
  const std::string phong = "Kd 0.5 0.5 0.5\nKs 0.25 0.25 0.25\nNs 20\n";
  const auto decoded = [](double x) { return std::pow((x + 0.055) / 1.055, 2.4); };
  const double diffuse = decoded(0.5) / std::numbers::pi;
  // (n + 2) / 2π in the mirror direction, Kd/π everywhere.
  const double peak = diffuse + decoded(0.25) * 22 / (2 * std::numbers::pi);
  CHECK(bsdfOfMtl(phong + "illum 2\n")->eval(wi, mirrored, {0, 0}).y() == Approx(peak).epsilon(1e-4));
  // Model 2 without highlights is diffuse, as are 0, 1 and 3.
  for (const std::string& text :
       {phong + "Ns 0\nillum 2\n", phong + "Ks 0 0 0\nillum 2\n", phong + "illum 1\n", phong + "illum 3\n", phong})
    CHECK(bsdfOfMtl(text)->eval(wi, mirrored, {0, 0}).y() == Approx(diffuse).epsilon(1e-5));
  for (const int glass : {4, 6, 7, 9}) {
    const BsdfPtr bsdf = bsdfOfMtl(phong + fmt::format("illum {}\n", glass));
    CHECK(bsdf->sampleDelta(kUp, {0, 0}, 0.999f)->wi.z() == Approx(-1));  // light is transmitted
  }
  for (const int metal : {5, 8}) {
    const BsdfPtr bsdf = bsdfOfMtl(phong + fmt::format("illum {}\n", metal));
    const auto reflected = bsdf->sampleDelta(kUp, {0, 0}, 0.5f);
    REQUIRE(reflected);
    CHECK(reflected->wi.z() == Approx(1));
    CHECK((reflected->weight > 0.88f && reflected->weight < 0.94f).all());  // aluminium
  }
}

TEST_CASE("scenes: opacity and images and bump maps of an MTL") {
  const ObjScene files(
      "newmtl red\nKd 1 1 1\nd 0.25\nnewmtl green\nmap_Kd maps\\half grey.bmp\nnewmtl unknown\nmap_d gone.bmp\n"
      "map_Kd -s 2 2 2 grey.bmp\n");
  std::filesystem::create_directory(files.folder.path() / "maps");
  files.folder.write("maps/half grey.bmp", onePixel(188, 0, 255));
  files.folder.write("grey.bmp", onePixel(255, 255, 255));
  const Scene scene = files.read();
  REQUIRE(scene.shapes.size() == 3);
  CHECK(isNear(bsdfOf(scene, 0).eval(kUp, kUp, {0, 0}), grey(0.25f / std::numbers::pi_v<float>)));
  CHECK(isNear(albedoOf(scene, 1), Rgb(0.5029f, 0, 1), 1e-3f));
  // A missing image is replaced by black, which here makes the surface fully transparent.
  CHECK(isNear(bsdfOf(scene, 2).eval(kUp, kUp, {0, 0}), Rgb::Zero()));
  REQUIRE(scene.warnings.size() == 2);
  CHECK_THAT(scene.warnings[0], Contains("options of the image") && Contains("line 8"));
  CHECK_THAT(scene.warnings[1], Contains("test.xml:2:") && Contains("gone.bmp does not exist: black is used"));
}

TEST_CASE("scenes: a bump map of an MTL tilts the normal") {
  const ObjScene files("newmtl red\nKd 1 1 1\nbump slope.bmp\n");
  // Two pixels, black and white: between their centres the height rises by 1 in half of the image.
  std::string slope = onePixel(0, 0, 0);
  slope[18] = 2;
  slope.resize(54);
  slope += std::string("\0\0\0\xff\xff\xff\0\0", 8);
  files.folder.write("slope.bmp", slope);
  const Scene scene = files.read();
  const Vec3 normal = bsdfOf(scene, 0).perturbedNormal(Vec3::UnitZ(), {0.5f, 0.5f}, Vec3::UnitX(), Vec3::UnitY());
  CHECK(normal.z() == Approx(1 / std::sqrt(5)).epsilon(1e-3));
  CHECK(normal.x() == Approx(-2 / std::sqrt(5)).epsilon(1e-3));
}

// As sRGB, 0.9 is 0.787 and 0.6 is 0.319.
TEST_CASE("scenes: colours of an MTL whose sum exceeds 1 are scaled with a warning") {
  const ObjScene files("newmtl red\nKd 0.9 0 0\nKs 0.6 0 0\nNs 10\nillum 2\n");
  const Scene scene = files.read();
  REQUIRE(scene.warnings.size() == 1);
  CHECK_THAT(scene.warnings[0],
             Catch::Contains("the sum of specular_reflectance and diffuse_reflectance is up to 1.106"));
  CHECK(bsdfOf(scene, 0).albedo(Vec3::UnitZ(), {0.5f, 0.5f}).x() == Approx(0.99f));
}

TEST_CASE("scenes: a missing or malformed library causes a warning") {
  const Scene absent = ObjScene("").read();
  REQUIRE(absent.warnings.size() == 1);
  CHECK_THAT(absent.warnings[0], Contains("test.xml:2:19: ") && Contains("colours.mtl: no such file"));
  REQUIRE(absent.shapes.size() == 1);
  CHECK(isNear(albedoOf(absent, 0), grey(0.5f)));
  const Scene damaged = ObjScene("newmtl red\nKd one 0 0\n").read();
  REQUIRE(damaged.warnings.size() == 1);
  CHECK_THAT(damaged.warnings[0], Contains("colours.mtl: line 2: \"one\" is not a number"));
}

TEST_CASE("scenes: a library that exists but cannot be read is a fault") {
  const ObjScene files("");
  std::filesystem::create_directory(files.folder.path() / "colours.mtl");
  CHECK_THROWS_WITH(files.read(), Contains("test.xml:2:19: ") && Contains("colours.mtl: is a folder, not a file"));
}

TEST_CASE("scenes: lenient reading leaves out every shape whose material has a damaged image") {
  const ObjScene files("newmtl red\nmap_Kd broken.png\n",
                       "mtllib colours.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n");
  files.folder.write("broken.png", "not a picture");
  const std::string obj = "<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape>";
  const std::string text = "<scene version=\"0.6.0\"><shape type=\"sphere\"/>" + obj + obj + kSensor + "</scene>";
  CHECK(readScene(files.folder.write("test.xml", text), lenient()).shapes.size() == 1);
}

TEST_CASE("scenes: maxSmoothAngle is read and excludes flat faces") {
  const std::string folded = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 0 1 1\nf 1 2 3 4\nf 5 1 4 6\n";
  const ObjScene files("", folded);
  const auto angle = [](int degrees) { return fmt::format("<float name=\"maxSmoothAngle\" value=\"{}\"/>", degrees); };
  const auto vertices = [&](const std::string& content) {
    return std::get<TriangleMesh>(files.read(content).shapes.at(0).geometry).positions.size();
  };
  CHECK(vertices("") == 6);
  CHECK(vertices(angle(100)) == 6);
  CHECK(vertices(angle(30)) == 8);
  CHECK_THROWS_WITH(files.read(angle(30) + "<boolean name=\"faceNormals\" value=\"true\"/>"),
                    Contains("either face_normals or max_smooth_angle"));
  CHECK_THROWS_WITH(files.read(angle(181)), Contains("between 0 and 180"));
}

TEST_CASE("scenes: objects that are too far away are rejected with their location") {
  const auto moved = [](const std::string& type, const std::string& to) {
    return "<" + type + "><transform name=\"to_world\"><translate x=\"" + to + "\"/></transform></";
  };
  const std::string limit = "over 1e+15";
  CHECK_THAT(faultOf(moved("shape type=\"sphere\"", "1e16") + "shape>"),
             Contains("test.xml:2:22: ") && Contains(limit));
  CHECK_THAT(faultOf(moved("shape type=\"disk\"", "1e16") + "shape>"), Contains(limit));
  CHECK_THAT(faultOf(moved("shape type=\"cylinder\"", "1e16") + "shape>"), Contains(limit));
  CHECK_THAT(faultOf(moved("shape type=\"rectangle\"", "-1e16") + "shape>"), Contains(limit));
  CHECK_THAT(faultOf(moved("emitter type=\"point\"", "1e16") + "emitter>"), Contains(limit));
  CHECK_THAT(faultOf(moved("emitter type=\"spot\"", "1e16") + "emitter>"), Contains(limit));
  CHECK_THAT(faultOf("<emitter type=\"point\"><point name=\"position\" x=\"1e16\" y=\"0\" z=\"0\"/></emitter>"),
             Contains("test.xml:2:23: ") && Contains(limit));
  CHECK_THAT(faultOf(moved("sensor type=\"perspective\"", "3e18") + "sensor>"), Contains(limit));
  const std::string group = "<shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\"/></shape>";
  const std::string instance = "<shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\"><scale value=\"";
  CHECK_THAT(faultOf(group + instance + "1e16\"/></transform></shape>"),
             Contains("test.xml:2:61: ") && Contains(limit));
  CHECK(faultOf(group + instance + "1e-30\"/></transform></shape>") == "");
}

TEST_CASE("scenes: equal triangles of an emitter are one light, with a note") {
  const ObjScene scene("", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 1\nf 3 2 1\n");
  const auto triangles = [](const Scene& s) {
    return std::get<TriangleMesh>(s.shapes.at(0).geometry).triangles.size();
  };
  const Scene dark = scene.read();
  CHECK(triangles(dark) == 3);
  CHECK(dark.notes.empty());
  const Scene bright = scene.read("<emitter type=\"area\"><rgb name=\"radiance\" value=\"1\"/></emitter>");
  CHECK(triangles(bright) == 2);
  REQUIRE(bright.notes.size() == 1);
  CHECK_THAT(bright.notes[0], Contains("1 triangles are equal"));
}

TEST_CASE("scenes: all files that a scene names are known") {
  const ObjScene scene("newmtl red\nKd 1 0 0\nmap_Kd red.tga\n");
  scene.folder.write("red.tga", std::string("\0\0\2\0\0\0\0\0\0\0\0\0\1\0\1\0\x18\0rgb", 21));
  scene.folder.write("part.xml", "<scene version=\"0.6.0\"/>");
  const Scene read = readScene(scene.folder.write(
      "test.xml", "<scene version=\"0.6.0\"><include filename=\"part.xml\"/>" + sceneOfObj("").substr(23)));
  for (const char* name : {"a.obj", "colours.mtl", "red.tga", "part.xml"})
    CHECK(std::ranges::count(read.files, scene.folder.path() / name) == 1);
}

TEST_CASE("scenes: the meshes of all shapes together are limited") {
  const TestFolder folder;
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";  // 4 triangles and vertices
  folder.write("a.obj", obj);
  folder.write("b.obj", obj);
  std::filesystem::create_symlink("a.obj", folder.path() / "link.obj");
  const auto shape = [](const std::string& name) {
    return "<shape type=\"obj\"><string name=\"filename\" value=\"" + name + "\"/></shape>";
  };
  const auto read = [&](const std::string& body) { return readShapes(folder.write("test.xml", sceneOf(body))); };
  const std::size_t limit = 20 * obj.size();
  const int most = static_cast<int>(limit / 4);

  const ReadShapes within = read(repeated(most, shape("a.obj")));
  CHECK(within.faults.empty());
  CHECK(within.scene.shapes.size() == static_cast<std::size_t>(most));
  CHECK(read(repeated(most, shape("a.obj") + shape("b.obj"))).faults.empty());

  const std::string others = shape("none.obj") + shape("./a.obj") + shape("link.obj") + "<shape type=\"sphere\"/>";
  const ReadShapes beyond = read(repeated(most, shape("a.obj")) + others);
  REQUIRE(beyond.faults.size() == 1);
  CHECK(beyond.faults[0].count == static_cast<std::size_t>(most) + 3);
  CHECK_THAT(beyond.faults[0].where, Catch::EndsWith("test.xml:2:19"));
  CHECK(
      beyond.faults[0].message ==
      fmt::format("shape \"obj\": the meshes of the scene have more than {} triangles and vertices together, the limit "
                  "for {} bytes of mesh files",
                  limit, obj.size()));
  REQUIRE(beyond.scene.shapes.size() == 1);
  CHECK(std::holds_alternative<Sphere>(beyond.scene.shapes[0].geometry));

  const std::string group = "<shape type=\"shapegroup\" id=\"g\">" + shape("a.obj") + "</shape>";
  const ReadShapes placed = read(group + repeated(2 * most, "<shape type=\"instance\"><ref id=\"g\"/></shape>"));
  CHECK(placed.faults.empty());
  CHECK(placed.scene.shapes.size() == static_cast<std::size_t>(2 * most));
}

TEST_CASE("scenes: the materials that all shapes have from libraries are limited") {
  constexpr int kMaterials = 1 << 13;
  std::string library, obj = "mtllib colours.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < kMaterials; ++i) {
    library += fmt::format("newmtl {}\n", i);
    obj += fmt::format("usemtl {}\nf 1 2 3\n", i);
  }
  const ObjScene files(library, obj);
  const std::string shape = "<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape>\n";
  ReadOptions options;
  options.geometry = false;
  // 32 of the shapes are within the limit of 2^18.
  const std::string text = "<scene version=\"0.6.0\">\n" + repeated(35, shape) + "</scene>";
  const SceneCheck found = checkScene(files.folder.write("test.xml", text), options);
  REQUIRE(found.faults.size() == 1);
  CHECK(found.faults[0].count == 3);
  CHECK_THAT(found.faults[0].where, Catch::EndsWith("test.xml:34:19"));
  CHECK_THAT(found.faults[0].message, Contains("more than 262144 materials from libraries of OBJ files"));
}

// Moving the other shapes for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: many shapes without a face are removed in linear time", "[slow]") {
  constexpr int kEmpty = 400000;
  const TestFolder folder;
  folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  std::string text = "<bsdf type=\"diffuse\" id=\"a\"/><shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/>";
  for (int i = 0; i < kEmpty; ++i) text += fmt::format("<ref name=\"m{}\" id=\"a\"/>", i);
  text += "</shape>";
  for (int i = 0; i < kEmpty; ++i) text += "<shape type=\"sphere\"/>";
  const Scene scene = readScene(folder.write("test.xml", sceneOf(text)));
  CHECK(scene.shapes.size() == kEmpty + 1);
  REQUIRE(scene.notes.size() == kEmpty);
  CHECK(scene.notes.front() == "a.obj: no face has the material \"m0\"");
}
