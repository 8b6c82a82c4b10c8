// How the reader interprets scene files: spellings, references, transforms, cameras, lights, textures.

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "scenes/camera.h"
#include "tests/support/scenes_test_tools.h"

namespace lobe {
namespace {

const Vec3 kUp = Vec3::UnitZ();

Rgb albedoOf(const Scene& scene, int material) {
  return scene.materials.at(static_cast<std::size_t>(material)).bsdf->albedo(kUp, Vec2(0.25f, 0.25f));
}

const TriangleMesh& meshOf(const Scene& scene, std::size_t shape = 0) {
  return std::get<TriangleMesh>(scene.shapes.at(shape).geometry);
}

/// The image of (1, 2, 3) under the transform, read as that of a sensor.
Vec3 moved(const std::string& steps) {
  const Scene scene = readText("<scene><sensor type=\"perspective\"><transform name=\"to_world\">" + steps +
                               "</transform></sensor></scene>");
  return (scene.camera.toWorld * Eigen::Vector4f(1, 2, 3, 1)).head<3>();
}

void checkNear(const Vec3& value, const Vec3& expected) {
  INFO(value.transpose() << " against " << expected.transpose());
  CHECK((value - expected).norm() < 1e-5f * (1 + expected.norm()));
}

Camera cameraOf(const std::string& parameters) {
  return readText("<scene><sensor type=\"perspective\">" + parameters +
                  "<film type=\"hdrfilm\"><integer name=\"width\" value=\"400\"/><integer name=\"height\" "
                  "value=\"200\"/></film></sensor></scene>")
      .camera;
}

double tangent(double degrees) {
  return std::tan(0.5 * degrees * std::numbers::pi / 180);
}

/// A 2×1 black-and-white image as an uncompressed 24-bit BMP, rows padded to four bytes.
std::string blackAndWhiteBmp() {
  std::string bytes("BM\x3e\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x02\0\0\0\x01\0\0\0\x01\0\x18\0\0\0\0\0\x08\0\0\0", 38);
  bytes += std::string(16, '\0');
  return bytes + std::string("\0\0\0\xff\xff\xff\0\0", 8);
}

}  // namespace

TEST_CASE("scenes: names in camelCase and in snake_case are equivalent") {
  for (const std::string spelling : {"<rgb name=\"diffuseReflectance\" value=\"0.1 0.2 0.3\"/>",
                                     "<rgb name=\"diffuse_reflectance\" value=\"0.1, 0.2, 0.3\"/>",
                                     "<spectrum name=\"diffuseReflectance\" value=\"0.1,0.2,0.3\"/>"}) {
    const Scene scene = readBody("<shape type=\"sphere\"><bsdf type=\"diffuse\">" + spelling + "</bsdf></shape>");
    CHECK((albedoOf(scene, 0) - Rgb(0.1f, 0.2f, 0.3f)).matrix().norm() < 1e-6f);
  }
  const std::string old =
      "<bsdf type=\"roughplastic\"><float name=\"intIOR\" value=\"1.6\"/>"
      "<float name=\"alpha\" value=\"0.2\"/></bsdf>";
  const std::string today =
      "<bsdf type=\"roughplastic\"><float name=\"int_ior\" value=\"1.6\"/>"
      "<float name=\"alpha\" value=\"0.2\"/></bsdf>";
  const Scene a = readBody("<shape type=\"disk\">" + old + "</shape>");
  const Scene b = readBody("<shape type=\"disk\">" + today + "</shape>");
  CHECK((albedoOf(a, 0) == albedoOf(b, 0)).all());
  CHECK(faultOf("<shape type=\"disk\"><bsdf type=\"roughconductor\"><float name=\"alphaU\" value=\"0.1\"/>"
                "<float name=\"alphaV\" value=\"0.2\"/><string name=\"material\" value=\"Al\"/>"
                "<float name=\"extEta\" value=\"1\"/></bsdf></shape>") == "");
}

TEST_CASE("scenes: colours are read from one number or three numbers or sRGB codes") {
  const auto colour = [](const std::string& element) {
    return albedoOf(readBody("<shape type=\"sphere\"><bsdf type=\"diffuse\">" + element + "</bsdf></shape>"), 0);
  };
  CHECK((colour("<rgb name=\"reflectance\" value=\"0.25\"/>") == 0.25f).all());
  CHECK((colour("<spectrum name=\"reflectance\" value=\"0.25\"/>") == 0.25f).all());
  CHECK((colour("<float name=\"reflectance\" value=\"0.25\"/>") == 0.25f).all());
  const Rgb decoded = colour("<srgb name=\"reflectance\" value=\"#ff8000\"/>");
  CHECK(decoded.x() == Approx(1.0f));
  CHECK(decoded.y() == Approx(0.21586f).epsilon(1e-4));
  CHECK(decoded.z() == 0.0f);
}

TEST_CASE("scenes: camera and luminaire of Mitsuba 0.4 are read as sensor and emitter") {
  const Scene scene = readText(
      "<scene version=\"0.4.0\"><camera type=\"perspective\"><float name=\"fov\" value=\"33\"/></camera>"
      "<shape type=\"sphere\"><luminaire type=\"area\"><rgb name=\"radiance\" "
      "value=\"3\"/></luminaire></shape></scene>");
  CHECK(scene.camera.fov == 33.0f);
  REQUIRE(scene.shapes.at(0).emitter);
  CHECK((scene.shapes[0].emitter->radiance->mean() == 3.0f).all());
}

TEST_CASE("scenes: definitions on the command line must not contain names, unlike defaults in the file") {
  const auto sphere = [](const std::string& defaults) {
    return sceneOf(defaults + "<shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/></shape>");
  };
  for (const std::string value : {"$x", "2$", "$r"}) {
    ReadOptions options;
    options.definitions = {{"r", value}};
    const std::string expected =
        "test.xml:1:1: -D defines $r as \"" + value + "\": the value of a definition must not contain $";
    CHECK(faultOfText(sphere(""), options) == expected);
    options.lenient = true;
    CHECK(faultOfText(sphere(""), options) == expected);
  }
  ReadOptions options;
  options.definitions = {{"x", "3"}};
  const Scene scene = readText(sphere("<default name=\"r\" value=\"$x\"/>"), options);
  CHECK(std::get<Sphere>(scene.shapes.at(0).geometry).radius == 3);
}

TEST_CASE("scenes: definitions on the command line override the defaults of the file") {
  const std::string text =
      "<scene><default name=\"w\" value=\"64\"/><default name=\"h\" value=\"32\"/><sensor type=\"perspective\">"
      "<film type=\"hdrfilm\"><integer name=\"width\" value=\"$w\"/><integer name=\"height\" value=\"1$h\"/></film>"
      "</sensor></scene>";
  const Scene plain = readText(text);
  CHECK(plain.camera.width == 64);
  CHECK(plain.camera.height == 132);
  ReadOptions options;
  options.definitions = {{"w", "17"}};
  CHECK(readText(text, options).camera.width == 17);
  // An unused default may be defined, but not a name that the scene does not contain.
  CHECK_NOTHROW(readText("<scene><default name=\"spp\" value=\"4\"/>" + std::string(kSensor) + "</scene>",
                         ReadOptions{{{"spp", "8"}}, false, true}));
  const std::string fault = faultOfText(text, ReadOptions{{{"width", "17"}}, false, true});
  CHECK(fault.starts_with("test.xml:1:1: "));
  CHECK(fault.find("$width") != std::string::npos);
  CHECK(fault.find("h, w") != std::string::npos);
}

TEST_CASE("scenes: references may precede their target and point into other elements") {
  const Scene scene = readBody(
      "<shape type=\"sphere\" id=\"Ball\"><ref id=\"Inner\"/></shape>"
      "<shape type=\"sphere\"><bsdf type=\"diffuse\"><ref name=\"reflectance\" id=\"Red\"/></bsdf></shape>"
      "<shape type=\"sphere\"><ref id=\"Inner\"/></shape>"
      "<bsdf type=\"bumpmap\"><texture type=\"checkerboard\"/><bsdf type=\"twosided\" id=\"Inner\">"
      "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.2\"/></bsdf></bsdf></bsdf>"
      "<bsdf type=\"diffuse\" id=\"Unused\"/>"
      "<texture type=\"checkerboard\" id=\"Red\"><rgb name=\"color0\" value=\"1 0 0\"/></texture>");
  REQUIRE(scene.materials.size() == 2);
  CHECK(scene.materials[0].name == "Inner");
  CHECK(scene.materials[1].name == "unnamed-1");
  CHECK(scene.shapes.at(0).name == "Ball");
  CHECK(scene.shapes.at(0).material == 0);
  CHECK(scene.shapes.at(1).material == 1);
  CHECK(scene.shapes.at(2).material == 0);
  CHECK((albedoOf(scene, 1) == Rgb(1, 0, 0)).all());
  // The nested BSDF, not the bump map around it.
  CHECK(scene.materials[0].bsdf->perturbedNormal(kUp, Vec2(0.5f, 0.5f), Vec3::UnitX(), Vec3::UnitY()) == kUp);
}

TEST_CASE("scenes: circular references are rejected") {
  const std::string fault = faultOf(
      "<bsdf type=\"twosided\" id=\"A\"><ref id=\"B\"/></bsdf>\n"
      "<bsdf type=\"twosided\" id=\"B\"><ref id=\"A\"/></bsdf>");
  CHECK(fault.starts_with("test.xml:2:1: a bsdf that refers to itself"));
}

TEST_CASE("scenes: integrators that contain themselves or are contained twice are rejected") {
  const auto integrator = [](const std::string& id, const std::string& content) {
    return "<integrator type=\"adaptive\" id=\"" + id + "\">" + content + "</integrator>\n";
  };
  const auto ref = [](const std::string& id) { return "<ref id=\"" + id + "\"/>"; };
  const std::string fault = "an integrator that contains itself, or that is contained twice";
  const std::string self = integrator("a", ref("a")), pair = integrator("a", ref("b")) + integrator("b", ref("a"));
  for (const std::string& body : {self, pair}) {
    CHECK(faultOf(body).starts_with("test.xml:2:1: " + fault));
    const TestFolder folder;
    const SceneCheck found = checkScene(folder.write("test.xml", sceneOf(body)));
    CHECK(found.faults.size() == 1);
    CHECK(!found.readable);
  }
  CHECK(faultOf(integrator("a", ref("b") + ref("b")) + integrator("b", "")).starts_with("test.xml:3:1: " + fault));

  // Without the limit, the last one would be read 2^40 times.
  std::string doubled;
  for (int i = 0; i < 40; ++i)
    doubled += integrator(std::to_string(i), ref(std::to_string(i + 1)) + ref(std::to_string(i + 1)));
  doubled += "<integrator type=\"path\" id=\"40\"><integer name=\"max_depth\" value=\"7\"/></integrator>";
  CHECK(readBody("<shape type=\"sphere\"/>\n" + doubled, lenient()).maxDepth == 7);
  CHECK(readBody("<shape type=\"sphere\"/>\n" + self, lenient()).shapes.size() == 1);

  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += integrator(std::to_string(i), ref(std::to_string(i + 1)));
  CHECK_THAT(faultOf(deep + integrator("100000", "")), Catch::Contains("nested more than 100 deep"));
}

TEST_CASE("scenes: transforms are applied in the order given") {
  checkNear(moved("<translate x=\"10\"/><scale value=\"2\"/>"), {22, 4, 6});
  checkNear(moved("<scale value=\"2\"/><translate value=\"10, 0, 0\"/>"), {12, 4, 6});
  checkNear(moved("<scale x=\"3\"/>"), {3, 2, 3});
  checkNear(moved("<rotate y=\"1\" angle=\"90\"/>"), {3, 2, -1});
  checkNear(moved("<rotate value=\"0, 0, 5\" angle=\"90\"/>"), {-2, 1, 3});
  checkNear(moved("<matrix value=\"0 1 0 5 1 0 0 6 0 0 1 7 0 0 0 1\"/>"), {7, 7, 10});
  checkNear(moved("<matrix value=\"0 1 0 1 0 0 0 0 2\"/>"), {2, 1, 6});
  // Local +z looks at the target, +y is up and +x left: looking along −z, left is −x.
  checkNear(moved("<lookat origin=\"0, 0, 5\" target=\"0, 0, 0\" up=\"0, 1, 0\"/>"), {-1, 2, 2});
  checkNear(moved("<lookAt origin=\"0 0 5\" target=\"0 0 0\" up=\"0 1 0\"/>"), {-1, 2, 2});
}

TEST_CASE("scenes: the centre of a sphere is scaled by its transform in new files only") {
  const auto centreIn = [](const std::string& version) {
    const Scene scene = readText(
        "<scene version=\"" + version +
        "\"><shape type=\"sphere\"><point name=\"center\" x=\"1\" y=\"2\" z=\"3\"/><float name=\"radius\" value=\"2\"/>"
        "<transform name=\"toWorld\"><scale value=\"2\"/><rotate z=\"1\" angle=\"90\"/><translate "
        "x=\"10\"/></transform>"
        "</shape>" +
        kSensor + "</scene>");
    const auto& sphere = std::get<Sphere>(scene.shapes.at(0).geometry);
    CHECK(sphere.radius == Approx(4));
    return sphere.centre;
  };
  checkNear(centreIn("0.6.0"), {8, 1, 3});
  checkNear(centreIn("2.2.0"), {6, 2, 6});
  checkNear(centreIn("3.0.0"), {6, 2, 6});
}

TEST_CASE("scenes: a mirroring transform turns the front of a sphere inwards in new files only") {
  const auto flippedIn = [](const std::string& version) {
    const Scene scene = readText("<scene version=\"" + version +
                                 "\"><shape type=\"sphere\"><transform name=\"toWorld\"><scale x=\"-1\"/></transform>"
                                 "</shape>" +
                                 kSensor + "</scene>");
    return std::get<Sphere>(scene.shapes.at(0).geometry).flipped;
  };
  CHECK(!flippedIn("0.6.0"));
  CHECK(flippedIn("3.0.0"));
}

TEST_CASE("scenes: shapes are placed by their transform") {
  const Scene scene = readBody(
      "<shape type=\"rectangle\"><transform name=\"toWorld\"><translate z=\"4\"/></transform></shape>"
      "<shape type=\"sphere\"><point name=\"center\" x=\"1\" y=\"2\" z=\"3\"/><float name=\"radius\" value=\"2\"/>"
      "<transform name=\"to_world\"><scale value=\"2\"/></transform></shape>"
      "<shape type=\"cube\"/><shape type=\"disk\"><boolean name=\"flipNormals\" value=\"true\"/></shape>");
  REQUIRE(scene.shapes.size() == 4);
  for (const Vec3& position : meshOf(scene).positions) CHECK(position.z() == 4.0f);
  const Sphere& sphere = std::get<Sphere>(scene.shapes[1].geometry);
  checkNear(sphere.centre, {2, 4, 6});
  CHECK(sphere.radius == Approx(4));
  CHECK(meshOf(scene, 2).triangles.size() == 12);
  const Disk& disk = std::get<Disk>(scene.shapes[3].geometry);
  CHECK(disk.flipped);
}

TEST_CASE("scenes: a cylinder has the defaults of Mitsuba") {
  const Scene scene = readBody("<shape type=\"cylinder\"><float name=\"radius\" value=\"2\"/></shape>");
  const auto& cylinder = std::get<Cylinder>(scene.shapes.at(0).geometry);
  checkNear(cylinder.base, {0, 0, 0});
  checkNear(cylinder.axis, {0, 0, 1});
  CHECK(cylinder.u.norm() == Approx(2));
}

TEST_CASE("scenes: instances may precede or follow the definition of their group") {
  const std::string instance =
      "<shape type=\"instance\"><ref id=\"trees\"/><transform name=\"toWorld\"><translate "
      "x=\"5\"/></transform></shape>";
  const std::string group =
      "<shape type=\"shapegroup\" id=\"trees\"><shape type=\"cube\"/><shape type=\"sphere\"/></shape>";
  const Scene scene = readBody(instance + group + instance + "<shape type=\"disk\"/>");
  REQUIRE(scene.groups.size() == 1);
  CHECK(scene.groups[0].shapes.size() == 2);
  REQUIRE(scene.shapes.size() == 3);
  for (const std::size_t i : {0, 1}) {
    CHECK(std::get<Instance>(scene.shapes[i].geometry).group == 0);
    CHECK(std::get<Instance>(scene.shapes[i].geometry).toWorld.translation().x() == 5);
    CHECK(scene.shapes[i].material == -1);
  }
  CHECK(scene.groups[0].shapes[1].material == scene.shapes[2].material);
}

TEST_CASE("scenes: mesh files are relative to the scene and may have blanks in their names") {
  const TestFolder folder;
  folder.write("a mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.25\nf 1/1 2/1 3/1\n");
  const std::string shape = "<shape type=\"obj\"><string name=\"filename\" value=\"a mesh.obj\"/>";
  const Scene scene = readScene(
      folder.write("test.xml", sceneOf(shape + "<transform name=\"toWorld\"><translate z=\"2\"/></transform></shape>" +
                                       shape + "<boolean name=\"flipTexCoords\" value=\"false\"/></shape>")));
  REQUIRE(scene.shapes.size() == 2);
  CHECK(scene.shapes[0].name == "a mesh.obj");
  REQUIRE(meshOf(scene).triangles.size() == 1);
  CHECK(meshOf(scene).positions[0].z() == 2.0f);
  CHECK(meshOf(scene).uvs.at(0).y() == 0.75f);
  CHECK(meshOf(scene, 1).uvs.at(0).y() == 0.25f);
}

TEST_CASE("scenes: the materials of an OBJ are assigned by name") {
  const TestFolder folder;
  folder.write(
      "a.obj",
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nusemtl OakWood\nf 2 4 3\nf 1 2 4\nusemtl other\nf 1 4 3\n");
  const std::string colour = "<rgb name=\"reflectance\" value=\"1 0 0\"/></bsdf>";
  const Scene scene = readScene(folder.write(
      "test.xml", sceneOf("<bsdf type=\"diffuse\" id=\"red\">" + colour +
                          "<shape type=\"obj\" id=\"desk\"><string name=\"filename\" value=\"a.obj\"/>"
                          "<ref name=\"OakWood\" id=\"red\"/><bsdf type=\"diffuse\" name=\"absent\"/></shape>")));
  REQUIRE(scene.shapes.size() == 2);
  CHECK(scene.shapes[0].name == "desk:OakWood");
  CHECK(scene.materials[scene.shapes[0].material].name == "red");
  CHECK(meshOf(scene, 0).triangles.size() == 2);
  CHECK(scene.shapes[1].name == "desk");
  CHECK(meshOf(scene, 1).triangles.size() == 2);
  CHECK((albedoOf(scene, scene.shapes[1].material) == 0.5f).all());
  CHECK(scene.notes == std::vector<std::string>{"a.obj: no face has the material \"absent\""});
}

TEST_CASE("scenes: shapes without a bsdf are grey or black if they emit") {
  const Scene scene = readBody(
      "<shape type=\"sphere\"/><shape type=\"disk\"><emitter type=\"area\"/></shape>"
      "<shape type=\"cube\"/>");
  REQUIRE(scene.materials.size() == 2);
  CHECK(scene.shapes[0].material == scene.shapes[2].material);
  CHECK((albedoOf(scene, scene.shapes[0].material) == 0.5f).all());
  CHECK((albedoOf(scene, scene.shapes[1].material) == 0.0f).all());
  CHECK(scene.shapes[1].emitter.has_value());
}

TEST_CASE("scenes: the field of view is measured along its axis") {
  const auto fov = [](const std::string& axis) {
    return tangent(
        cameraOf("<float name=\"fov\" value=\"50\"/><string name=\"fovAxis\" value=\"" + axis + "\"/>").horizontalFov);
  };
  CHECK(tangent(cameraOf("<float name=\"fov\" value=\"50\"/>").horizontalFov) == Approx(tangent(50)));
  CHECK(fov("x") == Approx(tangent(50)));
  CHECK(fov("y") == Approx(2 * tangent(50)));
  CHECK(fov("smaller") == Approx(2 * tangent(50)));
  CHECK(fov("larger") == Approx(tangent(50)));
  CHECK(fov("diagonal") == Approx(tangent(50) * 2 / std::sqrt(5.0)));
  const Camera camera = cameraOf("<string name=\"focalLength\" value=\"50mm\"/>");
  CHECK(camera.fovAxis == "diagonal");
  CHECK(tangent(camera.fov) == Approx(std::hypot(36.0, 24.0) / 100));
  CHECK(tangent(horizontalFov(camera, 300, 400)) == Approx(tangent(camera.fov) * 3 / 5));
}

TEST_CASE("scenes: film and filter and depth are read and ignored elements are noted") {
  const Scene scene = readText(
      "<scene><integrator type=\"aov\"><integrator type=\"path\"><integer name=\"maxDepth\" value=\"7\"/></integrator>"
      "</integrator><sensor type=\"perspective\"><sampler type=\"sobol\"/><film type=\"hdrfilm\">"
      "<boolean name=\"banner\" value=\"false\"/></film></sensor></scene>");
  CHECK(scene.maxDepth == 7);
  CHECK(scene.filter.kind == PixelFilter::Kind::gaussian);
  CHECK(scene.filter.radius == 2.0f);
  CHECK(scene.camera.width == 768);
  REQUIRE(scene.notes.size() == 3);
  CHECK(scene.notes[0].find("aov") != std::string::npos);
  CHECK(scene.notes[1].find("sobol") != std::string::npos);
  CHECK(scene.notes[2].find("banner") != std::string::npos);
  CHECK_FALSE(readBody("<integrator type=\"path\"><integer name=\"max_depth\" value=\"-1\"/></integrator>").maxDepth);
}

TEST_CASE("scenes: media are rejected and left out by lenient reading") {
  const std::string body =
      "<medium type=\"homogeneous\" id=\"Fog\"/>\n<shape type=\"sphere\">"
      "<medium type=\"homogeneous\" name=\"interior\"><rgb name=\"sigmaA\" value=\"1\"/>"
      "</medium><ref name=\"exterior\" id=\"Fog\"/></shape>";
  CHECK_THAT(faultOf(body), Catch::StartsWith("test.xml:3:22: participating media are not supported"));
  const Scene scene = readBody(body, lenient());
  REQUIRE(scene.warnings.size() == 1);
  CHECK_THAT(scene.warnings[0], Catch::Contains("the medium is left out"));
  CHECK(scene.shapes.size() == 1);
  CHECK(faultOf("<medium type=\"homogeneous\" id=\"Unused\"/>") == "");
}

TEST_CASE("scenes: environments are read") {
  const Scene constant = readBody("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1 2 3\"/></emitter>");
  REQUIRE(constant.environment);
  CHECK((constant.environment->radiance.at(0, 0) == Rgb(1, 2, 3)).all());
  const TestFolder folder;
  folder.write("sky.bmp", blackAndWhiteBmp());
  const std::string map =
      "<emitter type=\"envmap\"><string name=\"filename\" value=\"sky.bmp\"/>"
      "<float name=\"scale\" value=\"3\"/><transform name=\"toWorld\">"
      "<rotate y=\"1\" angle=\"90\"/></transform></emitter>";
  const auto path = folder.write("test.xml", sceneOf(map));
  const Scene scene = readScene(path);
  REQUIRE(scene.environment);
  CHECK(scene.environment->radiance.width == 2);
  CHECK((scene.environment->radiance.at(0, 0) == 0.0f).all());
  CHECK((scene.environment->radiance.at(1, 0) == 3.0f).all());
  checkNear(scene.environment->toWorld * Vec3(1, 0, 0), {0, 0, -1});
  ReadOptions materialsOnly;
  materialsOnly.geometry = false;
  CHECK_FALSE(readScene(path, materialsOnly).environment);
  CHECK(
      faultOf("<emitter type=\"constant\"/>\n<emitter type=\"constant\"/>").starts_with("test.xml:3:1: a second env"));
}

TEST_CASE("scenes: point and spot and directional lights") {
  const Scene scene = readBody(
      "<emitter type=\"point\"><point name=\"position\" x=\"1\" y=\"2\" z=\"3\"/>"
      "<rgb name=\"intensity\" value=\"4 5 6\"/></emitter>"
      "<emitter type=\"point\"><transform name=\"toWorld\"><translate x=\"7\"/></transform>"
      "<float name=\"samplingWeight\" value=\"2\"/></emitter>"
      "<emitter type=\"spot\"><transform name=\"toWorld\"><lookat origin=\"1 0 0\" target=\"1 -2 0\" up=\"0 0 1\"/>"
      "</transform><float name=\"cutoffAngle\" value=\"40\"/></emitter>"
      "<emitter type=\"directional\"><vector name=\"direction\" y=\"-3\"/><float name=\"irradiance\" value=\"2\"/>"
      "</emitter>"
      "<emitter type=\"directional\"><transform name=\"toWorld\"><rotate y=\"1\" angle=\"90\"/></transform></emitter>");
  REQUIRE(scene.lights.size() == 5);
  CHECK(std::get<PointLight>(scene.lights[0]).position == Vec3(1, 2, 3));
  CHECK((std::get<PointLight>(scene.lights[0]).intensity == Rgb(4, 5, 6)).all());
  CHECK(std::get<PointLight>(scene.lights[1]).position == Vec3(7, 0, 0));
  CHECK(scene.notes ==
        std::vector<std::string>{"parameters without effect on the picture: sampling_weight of emitter \"point\""});
  const auto& spot = std::get<SpotLight>(scene.lights[2]);
  CHECK(spot.position == Vec3(1, 0, 0));
  CHECK(spot.direction.isApprox(Vec3(0, -1, 0)));
  CHECK(spot.cutoff == Approx(40 * std::numbers::pi / 180));
  CHECK(spot.beamWidth == Approx(30 * std::numbers::pi / 180));
  CHECK((spot.intensity == 1.0f).all());
  CHECK(std::get<DirectionalLight>(scene.lights[3]).direction.isApprox(Vec3(0, -1, 0)));
  CHECK((std::get<DirectionalLight>(scene.lights[3]).irradiance == 2.0f).all());
  CHECK(std::get<DirectionalLight>(scene.lights[4]).direction.isApprox(Vec3(1, 0, 0), 1e-5f));
}

TEST_CASE("scenes: thin lenses and orthographic cameras and crops and shifts and filters") {
  const auto sensor = [](const std::string& type, const std::string& body) {
    return readText("<scene><sensor type=\"" + type + "\">" + body + "</sensor></scene>");
  };
  const std::string aperture = "<float name=\"apertureRadius\" value=\"0.25\"/><float name=\"fov\" value=\"40\"/>";
  const Scene lens = sensor("thinlens", aperture + "<float name=\"focusDistance\" value=\"7\"/>");
  CHECK(lens.camera.kind == Camera::Kind::thinlens);
  CHECK(lens.camera.apertureRadius == 0.25f);
  CHECK(lens.camera.focusDistance == 7.0f);
  CHECK(lens.camera.horizontalFov == Approx(40));
  CHECK(lens.notes.empty());
  CHECK(sensor("thinlens", aperture).camera.focusDistance == 1e4f);
  CHECK(sensor("thinlens", aperture + "<float name=\"farClip\" value=\"50\"/>").camera.focusDistance == 50.0f);
  const Scene flat = sensor("orthographic", "<transform name=\"toWorld\"><scale x=\"10\" y=\"10\"/></transform>");
  CHECK(flat.camera.kind == Camera::Kind::orthographic);
  CHECK(flat.camera.toWorld(0, 0) == 10.0f);

  const Scene cropped =
      sensor("perspective",
             "<float name=\"principal_point_offset_x\" value=\"0.1\"/><float name=\"principal_point_offset_y\" "
             "value=\"-0.2\"/>"
             "<film type=\"ldrfilm\"><integer name=\"width\" value=\"100\"/><integer name=\"height\" value=\"50\"/>"
             "<integer name=\"cropOffsetX\" value=\"10\"/><integer name=\"cropWidth\" value=\"20\"/>"
             "<float name=\"gamma\" value=\"2.2\"/><float name=\"exposure\" value=\"1\"/>"
             "<rfilter type=\"mitchell\"><float name=\"B\" value=\"0.2\"/></rfilter></film>");
  CHECK(cropped.camera.shift == Vec2(0.1f, -0.2f));
  const FilmCrop picture = cropped.camera.picture();
  CHECK(std::array{picture.x, picture.y, picture.width, picture.height} == std::array{10, 0, 20, 50});
  CHECK(cropped.notes ==
        std::vector<std::string>{"film \"ldrfilm\": exposure is not applied: pictures hold linear RGB radiance",
                                 "film \"ldrfilm\": gamma is not applied: pictures hold linear RGB radiance"});
  CHECK(cropped.filter.kind == PixelFilter::Kind::mitchell);
  CHECK(cropped.filter.b == 0.2f);
  CHECK(cropped.filter.c == Approx(1.0 / 3));
}

TEST_CASE("scenes: bitmaps with wrap modes and scales and filters and encodings") {
  const TestFolder folder;
  folder.write("a b.bmp", blackAndWhiteBmp());
  const auto lookUp = [&](const std::string& parameters, const Vec2& uv) {
    const Scene scene = readScene(folder.write(
        "test.xml",
        sceneOf("<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\">"
                "<string name=\"filename\" value=\"a b.bmp\"/>" +
                parameters + "</texture></bsdf></shape>")));
    return scene.materials.at(0).bsdf->albedo(kUp, uv).x();
  };
  const std::string nearest = "<string name=\"filterType\" value=\"nearest\"/>";
  CHECK(lookUp(nearest, {0.2f, 0.5f}) == 0.0f);
  CHECK(lookUp(nearest, {0.8f, 0.5f}) == 1.0f);
  CHECK(lookUp("", {0.5f, 0.5f}) == Approx(0.5f));
  CHECK(lookUp(nearest + "<string name=\"wrap_mode\" value=\"mirror\"/>", {1.2f, 0.5f}) == 1.0f);
  CHECK(lookUp(nearest + "<string name=\"wrapModeU\" value=\"clamp\"/>", {7.2f, 0.5f}) == 1.0f);
  CHECK(lookUp(nearest, {7.2f, 0.5f}) == 0.0f);
  CHECK(lookUp(nearest + "<float name=\"uscale\" value=\"3\"/>", {0.25f, 0.5f}) == 1.0f);
  CHECK(lookUp(nearest + "<float name=\"uvscale\" value=\"3\"/>", {0.25f, 0.5f}) == 1.0f);
  CHECK(lookUp(nearest + "<float name=\"uvscale\" value=\"5\"/><float name=\"uscale\" value=\"3\"/>", {0.25f, 0.5f}) ==
        1.0f);
  CHECK(lookUp(nearest + "<float name=\"uoffset\" value=\"0.5\"/>", {0.2f, 0.5f}) == 1.0f);
  CHECK(lookUp(nearest + "<transform name=\"to_uv\"><scale x=\"3\"/></transform>", {0.25f, 0.5f}) == 1.0f);
  CHECK(lookUp(nearest + "<transform name=\"to_uv\"><translate x=\"0.5\"/></transform>", {0.2f, 0.5f}) == 1.0f);
}

TEST_CASE("scenes: the scale texture scales its nested texture") {
  const Scene scene = readBody(
      "<shape type=\"sphere\"><emitter type=\"area\"><texture name=\"radiance\" type=\"scale\">"
      "<rgb name=\"scale\" value=\"2 4 6\"/><texture type=\"checkerboard\"><float name=\"color0\" value=\"0.5\"/>"
      "<float name=\"color1\" value=\"0.5\"/></texture></texture></emitter></shape>");
  CHECK((scene.shapes.at(0).emitter->radiance->eval(Vec2(0.1f, 0.1f)) == Rgb(1, 2, 3)).all());
}

TEST_CASE("scenes: reading without geometry reads all materials and no mesh") {
  ReadOptions options;
  options.geometry = false;
  const Scene scene = readText(
      "<scene><shape type=\"obj\"><string name=\"filename\" value=\"none.obj\"/><bsdf type=\"diffuse\" id=\"A\"/>"
      "</shape></scene>",
      options);
  REQUIRE(scene.materials.size() == 1);
  CHECK(scene.materials[0].name == "A");
}

TEST_CASE("scenes: the sensor of another file replaces that of the scene") {
  const TestFolder folder;
  const std::string scene =
      "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"7\"/></integrator>"
      "<sensor type=\"nonsense\"/><shape type=\"sphere\"/></scene>";
  const std::string camera =
      "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"3\"/></integrator>"
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"$fov\"/><film type=\"hdrfilm\">"
      "<integer name=\"width\" value=\"40\"/><integer name=\"height\" value=\"30\"/>"
      "<integer name=\"crop_width\" value=\"20\"/></film></sensor><shape type=\"cube\"/></scene>";
  ReadOptions options;
  options.definitions = {{"fov", "35"}};
  options.camera = folder.write("camera.xml", camera);
  const Scene read = readScene(folder.write("scene.xml", scene), options);
  CHECK(read.camera.fov == 35);
  CHECK(read.camera.width == 40);
  CHECK(read.camera.picture().width == 20);
  CHECK(read.maxDepth == 7);
  CHECK(read.shapes.size() == 1);
  options.definitions["speed"] = "1";
  CHECK_THROWS_WITH(readScene(folder.path() / "scene.xml", options), Catch::Contains("$speed"));
}

}  // namespace lobe
