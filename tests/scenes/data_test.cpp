// Complete scenes: our own, and third-party ones (the environment variable LOBE_DATA names their folder).

#include <algorithm>
#include <cstdlib>

#include <catch2/catch.hpp>

#include "scenes/mitsuba/reader.h"

namespace lobe {
namespace {

struct Known {
  const char* path;
  std::size_t shapes;
  std::size_t materials;
  int emitters;
  bool environment;
};

std::size_t triangleCount(const Scene& scene) {
  std::size_t count = 0;
  for (const Shape& shape : scene.shapes)
    if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry)) count += mesh->triangles.size();
  return count;
}

void checkConsistent(const Scene& scene) {
  for (const Shape& shape : scene.shapes) {
    REQUIRE(shape.material >= 0);
    REQUIRE(static_cast<std::size_t>(shape.material) < scene.materials.size());
    if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry)) CHECK_FALSE(mesh->triangles.empty());
  }
  CHECK(scene.warnings.empty());
}

/// nullptr, after a warning, if there is no data.
const char* dataFolder() {
  const char* folder = std::getenv("LOBE_DATA");
  if (!folder) WARN("LOBE_DATA is not set: skipped");
  return folder;
}

}  // namespace

TEST_CASE("scenes: the jewelry scene is read") {
  const Scene scene = readScene(LOBE_SOURCE_DIR "/scenes/jewelry.xml");
  checkConsistent(scene);
  CHECK(scene.shapes.size() == 15);
  REQUIRE(scene.materials.size() == 9);
  CHECK(scene.materials[0].name == "Base");
  CHECK(scene.materials[8].name == "Black");
  CHECK(scene.camera.width == 480);
  CHECK(scene.environment.has_value());
  CHECK(scene.filter.kind == PixelFilter::Kind::box);
}

TEST_CASE("scenes: the rooms are read") {
  const auto [name, materials] =
      GENERATE(std::pair{"livingroom", 40u}, std::pair{"kitchen", 20u}, std::pair{"kitchenette", 12u});
  const Scene scene = readScene(LOBE_SOURCE_DIR "/scenes/" + std::string(name) + ".xml");
  checkConsistent(scene);
  CHECK(scene.materials.size() >= materials);
}

TEST_CASE("scenes: measured materials are read in our own scenes") {
  const char* folder = dataFolder();
  if (!folder) return;
  const auto [type, file] = GENERATE(std::pair{"measured", "paper_white_rgb"}, std::pair{"merl", "pink-fabric"});
  const std::string suffix = std::string(type) == "merl" ? ".binary" : ".bsdf";
  ReadOptions options;
  options.definitions = {{"type", type}, {"file", std::string(folder) + "/measured/" + file + suffix}};
  const Scene ball = readScene(LOBE_SOURCE_DIR "/scenes/measured.xml", options);
  checkConsistent(ball);
  CHECK(ball.materials[1].bsdf->lobes()[0]->summary() == file);
  options.definitions["bowl"] = "Measured";
  const Scene jewelry = readScene(LOBE_SOURCE_DIR "/scenes/jewelry.xml", options);
  checkConsistent(jewelry);
  CHECK(std::ranges::count(jewelry.materials, "Measured", &Material::name) == 1);
}

TEST_CASE("scenes: third-party scenes are read") {
  const char* folder = dataFolder();
  if (!folder) return;
  const Known known = GENERATE(Known{"living-room", 65, 19, 0, true}, Known{"dining-room", 53, 15, 0, true},
                               Known{"veach-mis", 9, 6, 3, false}, Known{"cornell-box", 8, 8, 1, false},
                               Known{"veach-ajar", 16, 10, 1, false}, Known{"veach-bidir", 14, 4, 2, false},
                               Known{"staircase2", 32, 21, 13, false}, Known{"living-room-2", 184, 66, 4, false},
                               Known{"spaceship", 90, 15, 5, false});
  INFO(known.path);
  const Scene scene = readScene(std::filesystem::path(folder) / known.path / "scene.xml");
  checkConsistent(scene);
  CHECK(scene.shapes.size() == known.shapes);
  CHECK(scene.materials.size() == known.materials);
  CHECK(std::ranges::count_if(scene.shapes, [](const Shape& s) { return s.emitter.has_value(); }) == known.emitters);
  CHECK(scene.environment.has_value() == known.environment);
}

TEST_CASE("scenes: the kitchen and the dining room have a sunny sky") {
  const char* folder = dataFolder();
  if (!folder) return;
  const std::string name = GENERATE("kitchen", "dining-room");
  const Scene scene = readScene(std::filesystem::path(folder) / name / "scene_sunsky.xml");
  checkConsistent(scene);
  CHECK(scene.environment.has_value());
}

TEST_CASE("scenes: the kitchen is read") {
  const char* folder = dataFolder();
  if (!folder) return;
  const Scene scene = readScene(std::filesystem::path(folder) / "kitchen" / "scene.xml");
  checkConsistent(scene);
  CHECK(triangleCount(scene) == 1021815);
  CHECK(scene.shapes.size() == 286);
  CHECK(scene.materials.size() == 83);
  CHECK(std::ranges::count(scene.materials, "Cushion1", &Material::name) == 1);
  CHECK(scene.environment->radiance.width == 1024);
}

}  // namespace lobe
