// Faults while a scene with images and meshes of all formats is read: if an allocation, task or read fails, reading
// throws, or the scene is the same as without faults. In particular, no image, mesh or material is missing or replaced.

#include <filesystem>
#include <new>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "runtime/image/image_output.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/scene_hash.h"
#include "tests/faults/injection.h"
#include "tests/support/measured_files.h"
#include "tests/support/picture_files.h"
#include "tests/support/small_images.h"
#include "tests/support/tool_run.h"

namespace {

using namespace lobe;
using namespace lobe::test;

/// A serialized mesh of one triangle.
std::string serializedTriangle() {
  const std::string mesh = bytesOf(std::uint32_t{0x1000}) + std::string("name\0", 5) + bytesOf(std::uint64_t{3}) +
                           bytesOf(std::uint64_t{1}) + bytesOf(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}) +
                           bytesOf(std::vector<std::uint32_t>{0, 1, 2});
  return bytesOf(std::uint16_t{0x041c}) + bytesOf(std::uint16_t{4}) + deflated(mesh) + bytesOf(std::uint64_t{0}) +
         bytesOf(std::uint32_t{1});
}

std::string bitmap(const std::string& file) {
  return fmt::format(
      "<shape type=\"rectangle\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\"><string "
      "name=\"filename\" value=\"{}\"/></texture></bsdf></shape>",
      file);
}

std::string mesh(const std::string& type) {
  return fmt::format("<shape type=\"{0}\"><string name=\"filename\" value=\"a.{0}\"/></shape>", type);
}

/// A folder with scene.xml and its files.
class Files : public Folder {
 public:
  Files() {
    Image image(8, 8);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = grey(static_cast<float>(i % 9) / 9);
    for (const char* name : {"a.png", "b.png", "a.exr"}) writeImage(*this / name, image);
    const std::vector<std::uint8_t> codes(3 * 16 * 16, 100);
    write("a.jpg", pictureFile("jpg", 16, 16, codes));
    const std::vector<float> values(3 * 8 * 4, 0.5f);
    write("a.hdr", hdrFile(8, 4, values));
    write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl red\nf 1/1 2/1 3/1\n");
    write("a.mtl", "newmtl red\nmap_Kd b.png\n");
    write("a.ply",
          "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face "
          "1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    write("a.serialized", serializedTriangle());
    write("scene.xml",
          "<scene version=\"0.6.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>" +
              bitmap("a.png") + bitmap("a.jpg") + bitmap("a.exr") + mesh("obj") + mesh("ply") + mesh("serialized") +
              "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.hdr\"/></emitter></scene>");
  }
};

int injectInto(Countdown& countdown, bool lenient) {
  const Files files;
  ReadOptions options;
  options.lenient = lenient;
  std::uint64_t hash = 0;
  const auto read = [&] { hash = pictureHash(readScene(files / "scene.xml", options)); };
  return inject(countdown,
                {lenient ? "reading leniently" : "reading", files / "out", read, [&] { return std::to_string(hash); }});
}

}  // namespace

TEST_CASE("faults: failing allocations while attributes of images are copied") {
  const std::string text(100, 'x');  // longer than what strings store without an allocation
  const ImageAttributes attributes{{"a", text}, {"b", 1.0}, {"c", text}};
  int failed = 0;
  bool complete = false;
  for (long n = 1; !complete; ++n) {
    const Injection injection(allocations, n);
    try {
      const ImageAttributes copy = attributes;  // NOLINT(performance-unnecessary-copy-initialization)
      complete = true;
    } catch (const std::bad_alloc&) {
      ++failed;
    }
  }
  CHECK(failed == 5);  // the nodes of the map, and the texts
}

TEST_CASE("faults: failing reads of a scene, its images and its meshes") {
  CHECK(injectInto(reads, false) > 10);
}

TEST_CASE("faults: failing allocations and tasks while a scene, its images and its meshes are read") {
  for (const bool lenient : {false, true}) {
    CHECK(injectInto(allocations, lenient) > 50);
    CHECK(injectInto(tasks, lenient) > 0);
  }
}
