// Images, bitmap textures, mesh files and simple shapes.

#include <catch2/catch.hpp>

#include <unistd.h>

#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <fmt/format.h>
#include <Eigen/Geometry>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

#include "materials/textures/bitmap.h"
#include "materials/textures/checkerboard.h"
#include "runtime/image/image.h"
#include "scenes/meshes/obj.h"
#include "scenes/meshes/ply.h"
#include "scenes/meshes/primitives.h"

using namespace lobe;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// A temporary folder that is removed at the end.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "lobe-meshes-XXXXXX").string();
    REQUIRE(mkdtemp(name.data()));
    path_ = name;
  }
  ~Folder() { fs::remove_all(path_); }

  fs::path operator/(const std::string& name) const { return path_ / name; }

  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return path_ / name;
  }

 private:
  fs::path path_;
};

std::string bytesOf(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The message of the exception that the call throws; empty if there is none.
template <class Call>
std::string faultOf(const Call& call) {
  try {
    call();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return {};
}

void requireNear(const Rgb& actual, const Rgb& expected, float tolerance = 1e-5f) {
  CAPTURE(actual.transpose(), expected.transpose());
  REQUIRE((actual - expected).abs().maxCoeff() <= tolerance);
}

void requireNear(const Vec3& actual, const Vec3& expected, float tolerance = 1e-5f) {
  requireNear(Rgb(actual.array()), Rgb(expected.array()), tolerance);
}

Vec3 normalOf(const TriangleMesh& mesh, std::size_t triangle) {
  const auto& [i, j, k] = mesh.triangles[triangle];
  return (mesh.positions[j] - mesh.positions[i]).cross(mesh.positions[k] - mesh.positions[i]).normalized();
}

double areaOf(const TriangleMesh& mesh) {
  double area = 0;
  for (const auto& [i, j, k] : mesh.triangles)
    area += 0.5 * (mesh.positions[j] - mesh.positions[i]).cross(mesh.positions[k] - mesh.positions[i]).norm();
  return area;
}

MeshOptions placed(const Eigen::Affine3f& transform) {
  MeshOptions options;
  options.toWorld = transform.matrix();
  return options;
}

Eigen::Affine3f mirror() {
  return Eigen::Affine3f(Eigen::Scaling(-1.0f, 1.0f, 1.0f));
}

// ---- Images

using Imath::Box2i;
using Imath::V2i;

/// Pixel (x, y) of channel c is 100·c + 10·y + x, in the coordinates of the data window.
void writeExr(const fs::path& path, const std::vector<std::string>& channels, Imf::PixelType type, const Box2i& display,
              const Box2i& data, Imf::Compression compression = Imf::ZIP_COMPRESSION) {
  Imf::Header header(display, data);
  header.compression() = compression;
  const int width = data.max.x - data.min.x + 1, height = data.max.y - data.min.y + 1;
  std::vector<std::vector<float>> planes;
  std::vector<std::vector<half>> halves;
  Imf::FrameBuffer frame;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    header.channels().insert(channels[c], Imf::Channel(type));
    planes.emplace_back();
    for (int y = data.min.y; y <= data.max.y; ++y)
      for (int x = data.min.x; x <= data.max.x; ++x) planes[c].push_back(100.0f * c + 10.0f * y + x);
    halves.emplace_back(planes[c].begin(), planes[c].end());
  }
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const bool isHalf = type == Imf::HALF;
    const std::size_t size = isHalf ? sizeof(half) : sizeof(float);
    char* base = isHalf ? reinterpret_cast<char*>(halves[c].data()) : reinterpret_cast<char*>(planes[c].data());
    base -= static_cast<std::ptrdiff_t>(size) * (data.min.x + data.min.y * width);
    frame.insert(channels[c], Imf::Slice(type, base, size, size * width));
  }
  Imf::OutputFile file(path.c_str(), header);
  file.setFrameBuffer(frame);
  file.writePixels(height);
}

Box2i box(int left, int top, int right, int bottom) {
  return {V2i(left, top), V2i(right, bottom)};
}

/// 2×2 pixels: black, a grey of code 128; red, white.
const std::array<std::uint8_t, 12> kPixels = {0, 0, 0, 128, 128, 128, 255, 0, 0, 255, 255, 255};

}  // namespace

TEST_CASE("materials: 8-bit images are decoded with the requested encoding") {
  const Folder folder;
  const std::string png = (folder / "a.png").string(), bmp = (folder / "a.bmp").string(),
                    tga = (folder / "a.tga").string();
  REQUIRE(stbi_write_png(png.c_str(), 2, 2, 3, kPixels.data(), 6));
  REQUIRE(stbi_write_bmp(bmp.c_str(), 2, 2, 3, kPixels.data()));
  REQUIRE(stbi_write_tga(tga.c_str(), 2, 2, 3, kPixels.data()));
  for (const std::string& path : {png, bmp, tga}) {
    const Image image = readImage(path);
    REQUIRE(image.width == 2);
    REQUIRE(image.height == 2);
    requireNear(image.at(0, 0), grey(0));
    requireNear(image.at(1, 0), grey(0.2158605f));
    requireNear(image.at(0, 1), Rgb(1, 0, 0));
    requireNear(image.at(1, 1), grey(1));
  }
  requireNear(readImage(png, {Encoding::Kind::linear}).at(1, 0), grey(128 / 255.0f));
  requireNear(readImage(png, {Encoding::Kind::gamma, 2.0f}).at(1, 0), grey(128 * 128 / 65025.0f));
}

TEST_CASE("materials: JPEG and HDR images are read") {
  const Folder folder;
  const std::string jpg = (folder / "a.jpg").string(), hdr = (folder / "a.hdr").string();
  const std::vector<std::uint8_t> flat(16 * 16 * 3, 128);
  REQUIRE(stbi_write_jpg(jpg.c_str(), 16, 16, 3, flat.data(), 95));
  requireNear(readImage(jpg).at(7, 9), grey(0.2158605f), 0.01f);

  std::vector<float> values(16 * 4 * 3);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = 0.25f * static_cast<float>(i / 3 % 16);
  REQUIRE(stbi_write_hdr(hdr.c_str(), 16, 4, 3, values.data()));
  for (const Encoding::Kind kind : {Encoding::Kind::srgb, Encoding::Kind::gamma})
    requireNear(readImage(hdr, {kind, 2.2f}).at(9, 2), grey(2.25f), 0.02f);
}

TEST_CASE("materials: EXR images of half and float with colour and luminance") {
  const Folder folder;
  const fs::path path = folder / "a.exr";
  for (const Imf::PixelType type : {Imf::HALF, Imf::FLOAT})
    for (const Imf::Compression compression : {Imf::NO_COMPRESSION, Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION}) {
      writeExr(path, {"R", "G", "B", "A"}, type, box(0, 0, 4, 2), box(0, 0, 4, 2), compression);
      const Image image = readImage(path);
      REQUIRE(image.width == 5);
      REQUIRE(image.height == 3);
      for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 5; ++x) requireNear(image.at(x, y), 10.0f * y + x + Rgb(0, 100, 200), 0);
    }
  writeExr(path, {"Y"}, Imf::FLOAT, box(0, 0, 4, 2), box(0, 0, 4, 2));
  requireNear(readImage(path).at(3, 2), grey(23), 0);
  writeExr(path, {"Z", "N.X"}, Imf::FLOAT, box(0, 0, 4, 2), box(0, 0, 4, 2));
  const std::string fault = faultOf([&] { readImage(path); });
  REQUIRE_THAT(fault, Contains("a.exr") && Contains("N.X Z"));
}

TEST_CASE("materials: an EXR image has the size of its display window") {
  const Folder folder;
  const fs::path path = folder / "a.exr";
  writeExr(path, {"R", "G", "B"}, Imf::FLOAT, box(0, 0, 3, 3), box(1, 2, 2, 5));  // overlaps the lower edge
  const Image cropped = readImage(path);
  REQUIRE(cropped.width == 4);
  REQUIRE(cropped.height == 4);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) {
      const bool there = x >= 1 && x <= 2 && y >= 2;
      requireNear(cropped.at(x, y), there ? Rgb(10.0f * y + x + Rgb(0, 100, 200)) : grey(0), 0);
    }
  writeExr(path, {"Y"}, Imf::FLOAT, box(5, 6, 7, 8), box(5, 6, 7, 8));  // the same area, away from the origin
  requireNear(readImage(path).at(0, 0), grey(65), 0);
  writeExr(path, {"Y"}, Imf::FLOAT, box(0, 0, 2, 2), box(5, 6, 7, 8));  // disjoint
  requireNear(readImage(path).at(1, 1), grey(0), 0);
}

TEST_CASE("materials: damaged images are rejected with their name") {
  const Folder folder;
  const fs::path exr = folder / "whole.exr";
  writeExr(exr, {"R", "G", "B"}, Imf::FLOAT, box(0, 0, 40, 40), box(0, 0, 40, 40));
  const std::string bytes = bytesOf(exr);
  for (const double fraction : {0.01, 0.1, 0.5, 0.9, 0.999}) {
    const fs::path path = folder.write("cut.exr", bytes.substr(0, static_cast<std::size_t>(fraction * bytes.size())));
    CAPTURE(fraction);
    REQUIRE_THAT(faultOf([&] { readImage(path); }), Contains("cut.exr") && !Contains("\n"));
  }
  const std::string png = (folder / "whole.png").string();
  const std::vector<std::uint8_t> flat(64 * 64 * 3, 128);
  REQUIRE(stbi_write_png(png.c_str(), 64, 64, 3, flat.data(), 192));
  const std::string cut = bytesOf(png).substr(0, 60);
  REQUIRE_THAT(faultOf([&] { readImage(folder.write("cut.png", cut)); }), Contains("cut.png"));
  REQUIRE_THAT(faultOf([&] { readImage(folder.write("empty.png", "")); }), Contains("empty.png"));
  REQUIRE_THAT(faultOf([&] { readImage(folder.write("text.jpg", "no image")); }), Contains("text.jpg"));
  REQUIRE_THAT(faultOf([&] { readImage(folder / "missing.png"); }), Contains("missing.png: no such file"));
  REQUIRE_THAT(faultOf([&] { readImage(folder / "."); }), Contains("not a file"));
}

TEST_CASE("materials: truncated images of all formats are rejected") {
  const Folder folder;
  std::vector<std::uint8_t> noise(64 * 64 * 3);
  for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<std::uint8_t>(i * i / 7);
  const std::vector<float> steps(64 * 64 * 3, 0.5f), narrow(4 * 400 * 3, 0.5f);
  const auto name = [&folder](const char* file) { return (folder / file).string(); };
  REQUIRE(stbi_write_png(name("a.png").c_str(), 64, 64, 3, noise.data(), 192));
  REQUIRE(stbi_write_jpg(name("a.jpg").c_str(), 64, 64, 3, noise.data(), 90));
  REQUIRE(stbi_write_bmp(name("a.bmp").c_str(), 64, 64, 3, noise.data()));
  REQUIRE(stbi_write_tga(name("a.tga").c_str(), 64, 64, 3, noise.data()));
  REQUIRE(stbi_write_hdr(name("coded.hdr").c_str(), 64, 64, 3, steps.data()));
  REQUIRE(stbi_write_hdr(name("plain.hdr").c_str(), 4, 400, 3, narrow.data()));  // too narrow for run lengths
  for (const char* file : {"a.png", "a.jpg", "a.bmp", "a.tga", "coded.hdr", "plain.hdr"}) {
    CAPTURE(file);
    const std::string bytes = bytesOf(name(file));
    REQUIRE_NOTHROW(readImage(name(file)));
    for (const double fraction : {0.001, 0.1, 0.5, 0.9}) {
      const std::string cut = bytes.substr(0, static_cast<std::size_t>(fraction * bytes.size()));
      REQUIRE_THAT(faultOf([&] { readImage(folder.write(std::string("cut-") + file, cut)); }), Contains("cut-"));
    }
  }
}

TEST_CASE("materials: a small EXR file that claims a large image is rejected before memory is allocated") {
  const Folder folder;
  const fs::path exr = folder / "small.exr";
  writeExr(exr, {"Y"}, Imf::HALF, box(0, 0, 9, 9), box(0, 0, 9, 9));
  std::string bytes = bytesOf(exr);
  const std::size_t window = bytes.find("dataWindow") + std::strlen("dataWindow.box2i.size");
  const std::int32_t right = 9999999;
  std::memcpy(&bytes[window + 2 * sizeof(right)], &right, sizeof(right));
  REQUIRE_THAT(faultOf([&] { readImage(folder.write("claim.exr", bytes)); }),
               Contains("claim.exr: a file of") && Contains("cannot contain 10000000x10 pixels"));
}

TEST_CASE("materials: flipped bits in an EXR file never crash") {
  const Folder folder;
  const fs::path exr = folder / "whole.exr";
  writeExr(exr, {"R", "G", "B"}, Imf::HALF, box(0, 0, 9, 9), box(0, 0, 9, 9));
  const std::string bytes = bytesOf(exr);
  int refused = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ (1 << i % 8));
    const std::string fault = faultOf([&] { readImage(folder.write("bad.exr", damaged)); });
    if (!fault.empty()) ++refused;
    if (!fault.empty()) REQUIRE_THAT(fault, Contains("bad.exr"));
  }
  REQUIRE(refused > 10);
}

// ---- Textures

namespace {

/// 4×2, each pixel (x, y, 0).
std::shared_ptr<const Image> ramp() {
  auto image = std::make_shared<Image>(4, 2);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 4; ++x) image->at(x, y) = Rgb(x, y, 0);
  return image;
}

Vec2 centre(int x, int y) {
  return {(x + 0.5f) / 4, (y + 0.5f) / 2};
}

}  // namespace

TEST_CASE("materials: a bitmap has its pixel values at their centres and its first row at v = 0") {
  for (const bool nearest : {false, true}) {
    BitmapOptions options;
    options.nearest = nearest;
    const TexturePtr texture = makeBitmap(ramp(), options);
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 4; ++x) requireNear(texture->eval(centre(x, y)), Rgb(x, y, 0));
    requireNear(texture->mean(), Rgb(1.5f, 0.5f, 0));
    requireNear(texture->eval({0.5f, 0.25f}), nearest ? Rgb(2, 0, 0) : Rgb(1.5f, 0, 0));
    requireNear(texture->eval({0.375f, 0.4f}), nearest ? Rgb(1, 0, 0) : Rgb(1, 0.3f, 0));
  }
}

TEST_CASE("materials: bitmaps repeat or mirror or clamp for each axis separately") {
  const auto at = [](Wrap u, Wrap v, int x, int y) {
    BitmapOptions options;
    options.wrapU = u;
    options.wrapV = v;
    return makeBitmap(ramp(), options)->eval(centre(x, y));
  };
  requireNear(at(Wrap::repeat, Wrap::repeat, -1, 2), Rgb(3, 0, 0));
  requireNear(at(Wrap::repeat, Wrap::repeat, 403, -3), Rgb(3, 1, 0), 1e-3f);
  requireNear(at(Wrap::mirror, Wrap::mirror, -1, 2), Rgb(0, 1, 0));
  requireNear(at(Wrap::mirror, Wrap::mirror, 5, 4), Rgb(2, 0, 0));
  requireNear(at(Wrap::mirror, Wrap::mirror, 8, -4), Rgb(0, 0, 0));
  requireNear(at(Wrap::clamp, Wrap::clamp, -9, 9), Rgb(0, 1, 0));
  requireNear(at(Wrap::clamp, Wrap::clamp, 9, -9), Rgb(3, 0, 0));
  requireNear(at(Wrap::clamp, Wrap::repeat, 9, -1), Rgb(3, 1, 0));
  requireNear(at(Wrap::zero, Wrap::one, -1, 0), grey(0));
  requireNear(at(Wrap::zero, Wrap::one, 2, 2), grey(1));
  requireNear(at(Wrap::zero, Wrap::one, 2, 1), Rgb(2, 1, 0));
  // Interpolation crosses the seam only if the image repeats.
  requireNear(makeBitmap(ramp())->eval({0, 0.25f}), Rgb(1.5f, 0, 0));
  BitmapOptions clamped;
  clamped.wrapU = Wrap::clamp;
  requireNear(makeBitmap(ramp(), clamped)->eval({0, 0.25f}), Rgb(0, 0, 0));
}

TEST_CASE("materials: the coordinates of a bitmap are scaled and then shifted") {
  BitmapOptions options;
  options.uvMap.linear = Vec2(2, -1).asDiagonal();
  options.uvMap.offset = {0.25f, 1};
  const TexturePtr texture = makeBitmap(ramp(), options);
  requireNear(texture->eval({0.0625f, 0.25f}), Rgb(1, 1, 0));
  requireNear(texture->eval({0.1875f, 0.75f}), Rgb(2, 0, 0));
  options.uvMap.linear << 0, 1, 1, 0;
  options.uvMap.offset = {0, 0};
  requireNear(makeBitmap(ramp(), options)->eval({0.25f, 0.875f}), Rgb(3, 0, 0));
}

TEST_CASE("materials: bitmaps accept extreme coordinates and reject empty images") {
  const TexturePtr texture = makeBitmap(ramp());
  for (const float odd : {1e30f, -std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    REQUIRE(texture->eval({odd, 0.5f}).allFinite());
    REQUIRE(texture->eval({0.5f, odd}).allFinite());
  }
  REQUIRE_THROWS_AS(makeBitmap(std::make_shared<Image>()), std::runtime_error);
  REQUIRE_THROWS_AS(makeBitmap(nullptr), std::runtime_error);
}

TEST_CASE("materials: a checkerboard alternates its colours") {
  const TexturePtr a = constantTexture(Rgb(1, 0, 0)), b = makeBitmap(ramp());
  const TexturePtr board = makeCheckerboard(a, b);
  requireNear(board->eval({0.2f, 0.3f}), Rgb(1, 0, 0));
  requireNear(board->eval({0.7f, 0.8f}), Rgb(1, 0, 0));
  requireNear(board->eval({-0.3f, 5.8f}), Rgb(1, 0, 0));
  requireNear(board->eval(centre(2, 0)), Rgb(2, 0, 0));
  requireNear(board->mean(), Rgb(1.25f, 0.25f, 0));
  const TexturePtr fine = makeCheckerboard(a, b, {2 * Eigen::Matrix2f::Identity(), {0.5f, 0}});
  requireNear(fine->eval({0.05f, 0.3f}), Rgb(1, 0, 0));
  requireNear(fine->eval({0.35f, 0.3f}), b->eval({0.35f, 0.3f}));
}

// ---- OBJ

TEST_CASE("scenes: OBJ shares vertices and keeps normals and texture coordinates") {
  const Folder folder;
  const fs::path path =
      folder.write("quad.obj",
                   "# a square\r\nmtllib none.mtl\no quad\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\n"
                   "v 0 1e0 0 # corner\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0.25 0.75 0\nvn 0 0 2\n"
                   "usemtl none\ng first\ns 1\nf 1/1/1 2/2/1 3/3/1\ng second\nf -4/-4/-1 -2/-2/-1 -1/-1/-1");
  const TriangleMesh mesh = readObj(path, {});
  REQUIRE(mesh.positions.size() == 4);
  REQUIRE(mesh.triangles == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}});
  for (const Vec3& n : mesh.normals) requireNear(n, Vec3::UnitZ());
  REQUIRE(mesh.uvs[3] == Vec2(0.25f, 0.25f));  // v downwards
  REQUIRE(mesh.positions[2] == Vec3(1, 1, 0));

  MeshOptions asIs;
  asIs.flipTexCoords = true;
  REQUIRE(readObj(path, asIs).uvs[3] == Vec2(0.25f, 0.75f));
  MeshOptions flat;
  flat.faceNormals = true;
  REQUIRE(readObj(path, flat).normals.empty());
}

TEST_CASE("scenes: OBJ corners that differ in normal or uv become separate vertices") {
  const Folder folder;
  const std::string text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvn 0 1 1\nvt 0 0\nvt 1 1\n";
  const TriangleMesh normals = readObj(folder.write("a.obj", text + "f 1//1 2//1 3//1\nf 1//1 3//2 4//1\n"), {});
  REQUIRE(normals.positions.size() == 5);
  REQUIRE(normals.uvs.empty());
  const TriangleMesh uvs = readObj(folder.write("b.obj", text + "f 1/1 2/1 3/1\nf 1/2 3/1 4\n"), {});
  REQUIRE(uvs.positions.size() == 5);
  REQUIRE(uvs.uvs.back() == Vec2(0, 0));  // a corner without texture coordinates
}

TEST_CASE("scenes: convex and concave OBJ polygons are triangulated") {
  const Folder folder;
  const auto areaOfPolygon = [&folder](const std::vector<Vec2>& corners) {
    std::string text, face = "f";
    for (const Vec2& p : corners) text += fmt::format("v {} {} 3\n", p.x(), p.y());
    for (std::size_t i = 1; i <= corners.size(); ++i) face += fmt::format(" {}", i);
    const TriangleMesh mesh = readObj(folder.write("polygon.obj", text + face + "\n"), {});
    REQUIRE(mesh.triangles.size() == corners.size() - 2);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) requireNear(normalOf(mesh, i), Vec3::UnitZ());
    return areaOf(mesh);
  };
  REQUIRE(areaOfPolygon({{0, 0}, {4, 0}, {1, 1}, {0, 4}}) == Approx(4));
  REQUIRE(areaOfPolygon({{1, 1}, {0, 4}, {0, 0}, {4, 0}}) == Approx(4));
  REQUIRE(areaOfPolygon({{0, 4}, {0, 0}, {4, 0}, {1, 1}}) == Approx(4));
  // A comb with two teeth.
  REQUIRE(areaOfPolygon({{0, 0}, {5, 0}, {5, 3}, {4, 3}, {4, 1}, {3, 1}, {3, 3}, {0, 3}}) == Approx(13));
  std::vector<Vec2> round;
  for (int i = 0; i < 300; ++i)
    round.emplace_back(Eigen::Rotation2Df(i * 2 * std::numbers::pi_v<float> / 300) * Vec2(1, 0));
  REQUIRE(areaOfPolygon(round) == Approx(std::numbers::pi).epsilon(1e-3));
}

TEST_CASE("scenes: missing normals are averaged by angle unless flat ones are requested") {
  const Folder folder;
  // A corner of a cube: three squares, one of them as two triangles that must not count twice.
  const fs::path path = folder.write("corner.obj",
                                     "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\n"
                                     "f 1 2 3\nf 1 3 4\nf 5 6 2 1\nf 7 5 1 4\n");
  const TriangleMesh smooth = readObj(path, {});
  REQUIRE(smooth.normals.size() == smooth.positions.size());
  requireNear(smooth.normals[0], Vec3(1, 1, 1).normalized());
  REQUIRE(areaOf(smooth) == Approx(3));
  MeshOptions flat;
  flat.faceNormals = true;
  REQUIRE(readObj(path, flat).normals.empty());
  // One corner has no normal, so none of the file's normals are used.
  const TriangleMesh partial =
      readObj(folder.write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nf 1//1 2//1 3\n"), {});
  requireNear(partial.normals[0], Vec3::UnitZ());
}

TEST_CASE("scenes: transforms are applied to normals and keep the front") {
  const Folder folder;
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 1\n";
  const fs::path with = folder.write("with.obj", triangle + "vn 0 -1 1\nf 1//1 2//1 3//1\n");
  const fs::path without = folder.write("without.obj", triangle + "f 1 2 3\n");

  const Eigen::Affine3f stretched = Eigen::Translation3f(1, 2, 3) * Eigen::Scaling(1.0f, 1.0f, 3.0f);
  const TriangleMesh mesh = readObj(with, placed(stretched));
  requireNear(mesh.positions[2], Vec3(1, 3, 6));
  requireNear(mesh.normals[0], Vec3(0, -3, 1).normalized());
  requireNear(normalOf(mesh, 0), mesh.normals[0]);

  const TriangleMesh mirrored = readObj(with, placed(mirror()));
  requireNear(mirrored.normals[0], Vec3(0, -1, 1).normalized());
  requireNear(normalOf(mirrored, 0), mirrored.normals[0]);
  // Without normals, the winding in world space determines the front.
  const TriangleMesh wound = readObj(without, placed(mirror()));
  requireNear(normalOf(wound, 0), Vec3(0, 1, -1).normalized());
  requireNear(wound.normals[0], normalOf(wound, 0));

  for (const fs::path& path : {with, without}) {
    MeshOptions flipped;
    flipped.flipNormals = true;
    const TriangleMesh back = readObj(path, flipped);
    requireNear(back.normals[0], Vec3(0, 1, -1).normalized());
    requireNear(normalOf(back, 0), back.normals[0]);
  }
}

TEST_CASE("scenes: malformed OBJ files are rejected with their name") {
  const Folder folder;
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
  const auto fault = [&folder](const std::string& text) {
    const std::string what = faultOf([&] { readObj(folder.write("bad.obj", text), {}); });
    REQUIRE_THAT(what, Contains("bad.obj: ") && !Contains("\n"));
    return what;
  };
  REQUIRE_THAT(fault(vertices + "f 1 2 4\n"), Contains("vertex that does not exist (the file has 3)"));
  REQUIRE_THAT(fault(vertices + "f 1 2 -4\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 0 1 2\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 1 2 3 9\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 1 2 3 1 2 99999999999\n"), Contains("vertex"));
  REQUIRE_THAT(fault(vertices + "f 1/1 2/2 3/1\n"), Contains("texture coordinate"));
  REQUIRE_THAT(fault(vertices + "f 1//1 2//1 3//-2\n"), Contains("normal"));
  REQUIRE_THAT(fault("v 0 0 0\nv nan 0 0\n"), Contains("line 2"));
  REQUIRE_THAT(fault("v 0 0 0\n\nv 1 0\n"), Contains("line 3"));
  REQUIRE_THAT(fault(vertices + "f a b c\n"), Contains("line 6") && Contains("\"a\""));
  REQUIRE_THAT(fault(vertices + "f 99999999999999999999 1 2\n"), Contains("line 6") && Contains("999 1 2"));
  REQUIRE_THAT(fault(vertices + "f 1/99999999999999999999 2/1 3/1\n"), Contains("texture coordinate"));
  REQUIRE_THAT(fault(vertices + "f 1 2 3/1/1/1\n"), Contains("\"3/1/1/1\""));
  REQUIRE_THAT(fault(vertices + "\n\nf 1 2\n"), Contains("line 8") && Contains("three corners"));
  REQUIRE_THAT(fault("v 0 0 1e99\nv 0 1 0\nv 1 0 0\nf 1 2 3\n"), Contains("not a finite number"));
  REQUIRE_THAT(fault(vertices), Contains("no triangles"));
  REQUIRE_THAT(fault(""), Contains("no triangles"));
  REQUIRE_THAT(fault(std::string("\0\x7f\xff\n\0v f\n", 10)), Contains("no triangles"));
  REQUIRE_THAT(faultOf([&] { readObj(folder / "none.obj", {}); }), Contains("none.obj: no such file"));
  REQUIRE_THAT(faultOf([&] { readObj(folder / ".", {}); }), Contains("not a file"));
}

TEST_CASE("scenes: OBJ files with various line endings and indices and orders are read") {
  const Folder folder;
  const auto read = [&folder](const std::string& text) { return readObj(folder.write("a.obj", text), {}); };
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nvn 1 0 0\n";
  const std::string face = "f 1/1/1 2/1/1 3/1/1\n";
  const auto withEnds = [](std::string text, const std::string& end) {
    for (std::size_t i = 0; (i = text.find('\n', i)) != std::string::npos; i += end.size()) text.replace(i, 1, end);
    return text;
  };
  for (const std::string& text :
       {vertices + face, "\xef\xbb\xbf" + vertices + face, withEnds(vertices + face, "\r"),
        withEnds(vertices + face, "\r\n"), face + vertices, vertices + "f 1/1/1 \\\n 2/1/1 \\\r\n3/1/1 # end",
        "v 0 0 0 1 \\\n0.5 0\n" + vertices + "f -3/-1/-1 -2/-1/-1 +4/1/1"}) {
    CAPTURE(text);
    const TriangleMesh mesh = read(text);
    REQUIRE(mesh.triangles.size() == 1);
    REQUIRE(mesh.positions[1] == Vec3(1, 0, 0));
    REQUIRE(mesh.uvs[2] == Vec2(0.5f, 0.75f));
    REQUIRE(mesh.normals[0] == Vec3(1, 0, 0));
  }
  REQUIRE(read(vertices + "f 1/1/ 2/1/ 3/1/\n").normals[0] == Vec3::UnitZ());
  const TriangleMesh broken = read(vertices + "vt nan 0\nvn nan -nan(ind) 0\nf 1/2/2 2/1/1 3/1/1\n");
  REQUIRE(broken.uvs[0] == Vec2(0, 0));
  REQUIRE(broken.normals[0] == Vec3::UnitZ());
}

// ---- PLY

namespace {

template <class T>
void put(std::string& bytes, T value, bool big) {
  std::array<char, sizeof(T)> raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if (big != (std::endian::native == std::endian::big)) std::ranges::reverse(raw);
  bytes.append(raw.data(), raw.size());
}

const std::string kPlyElements =
    "comment a square and a triangle\nelement vertex 5\nproperty float x\nproperty double y\nproperty float z\n"
    "property uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n"
    "element face 2\nproperty list uchar short weights\nproperty list uchar int vertex_indices\n"
    "element edge 1\nproperty list uint float ends\nend_header\n";

const std::vector<std::array<double, 2>> kCorners = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0.5, 2}};

std::string asciiPly() {
  std::string text = "ply\nformat ascii 1.0\n" + kPlyElements;
  for (const auto& [x, y] : kCorners) text += fmt::format("{} {} 0 200 0 0 1 {} 0.25\n", x, y, x);
  return text + "1 7 4 0 1 2 3\n0\n3 3 2 4\n2 0 +1e0\n";
}

std::string binaryPly(bool big) {
  std::string bytes = fmt::format("ply\nformat binary_{}_endian 1.0\n", big ? "big" : "little") + kPlyElements;
  for (const auto& [x, y] : kCorners) {
    put(bytes, static_cast<float>(x), big);
    put(bytes, y, big);
    put(bytes, 0.0f, big);
    put(bytes, std::uint8_t{200}, big);
    for (const float f : {0.0f, 0.0f, 1.0f, static_cast<float>(x), 0.25f}) put(bytes, f, big);
  }
  const auto face = [&](int weights, std::initializer_list<std::int32_t> indices) {
    put(bytes, static_cast<std::uint8_t>(weights), big);
    for (int i = 0; i < weights; ++i) put(bytes, std::int16_t{7}, big);
    put(bytes, static_cast<std::uint8_t>(indices.size()), big);
    for (const std::int32_t i : indices) put(bytes, i, big);
  };
  face(1, {0, 1, 2, 3});
  face(0, {3, 2, 4});
  put(bytes, std::uint32_t{1}, big);
  put(bytes, 1.0f, big);
  return bytes;
}

}  // namespace

TEST_CASE("scenes: PLY files in text and in either byte order are read") {
  const Folder folder;
  for (const std::string& bytes : {asciiPly(), binaryPly(false), binaryPly(true)}) {
    const TriangleMesh mesh = readPly(folder.write("a.ply", bytes), {});
    REQUIRE(mesh.triangles == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}, {3, 2, 4}});
    REQUIRE(mesh.positions.size() == 5);
    REQUIRE(mesh.positions[4] == Vec3(0.5f, 2, 0));
    REQUIRE(mesh.normals[1] == Vec3::UnitZ());
    REQUIRE(mesh.uvs[4] == Vec2(0.5f, 0.25f));
  }
  MeshOptions turned;
  turned.flipTexCoords = true;
  REQUIRE(readPly(folder.write("a.ply", asciiPly()), turned).uvs[4] == Vec2(0.5f, 0.75f));
}

TEST_CASE("scenes: PLY files without normals or with other property names or line endings are read") {
  const Folder folder;
  const TriangleMesh mesh = readPly(
      folder.write(
          "a.ply",
          "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float "
          "z\r\nproperty float texture_u\r\nproperty float texture_v\r\nelement face 1\r\nproperty list int uint "
          "vertex_index\r\nend_header\r\n0 0 0 0 0\r\n2 0 0 1 0\r\n0 2 0 0 1\r\n3 0 1 2\r\n"),
      {});
  REQUIRE(mesh.triangles.size() == 1);
  requireNear(mesh.normals[0], Vec3::UnitZ());
  REQUIRE(mesh.uvs[2] == Vec2(0, 1));
}

TEST_CASE("scenes: malformed PLY files are rejected with their name") {
  const Folder folder;
  const auto fault = [&folder](const std::string& bytes) {
    const std::string what = faultOf([&] { readPly(folder.write("bad.ply", bytes), {}); });
    REQUIRE_THAT(what, Contains("bad.ply: ") && !Contains("\n"));
    return what;
  };
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  REQUIRE_THAT(fault(""), Contains("not a PLY"));
  REQUIRE_THAT(fault("plywood\n"), Contains("not a PLY"));
  REQUIRE_THAT(fault("ply\nformat ascii 1.0\n"), Contains("no end_header line"));
  REQUIRE_THAT(fault("ply\nend_header\n"), Contains("format"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "ascii", "morse")), Contains("morse"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "double", "quad")), Contains("quad"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "vertex 5", "vertex -5")), Contains("-5"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "property float x", "property float w")), Contains("x, y and z"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "vertex_indices", "corners")), Contains("vertex_indices"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "3 3 2 4", "3 3 2 5")), Contains("vertex 5, but there are 5"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "3 3 2 4", "3 3 2 -1")), Contains("-1"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "3 3 2 4", "3 3 2 x")), Contains("\"x\""));
  REQUIRE_THAT(fault(replaced(asciiPly(), "0.5 2 0", "0.5 nan 0")), Contains("finite"));
  REQUIRE_THAT(fault(replaced(asciiPly(), "face 2", "face 0")), Contains("no triangles"));
  const std::string huge = replaced(binaryPly(false), "vertex 5", "vertex 18446744073709551615");
  REQUIRE_THAT(fault(huge), Contains("truncated"));
  for (const std::string& bytes : {asciiPly(), binaryPly(false)})
    for (std::size_t size = 0; size + 12 < bytes.size(); size += 7) fault(bytes.substr(0, size));
  REQUIRE_THAT(faultOf([&] { readPly(folder / "none.ply", {}); }), Contains("none.ply: no such file"));
}

TEST_CASE("scenes: flipped bits in a PLY file never crash") {
  const Folder folder;
  const std::string bytes = binaryPly(false);
  int refused = 0;
  for (std::size_t i = 0; i < bytes.size() * 8; i += 5) {
    std::string damaged = bytes;
    damaged[i / 8] = static_cast<char>(damaged[i / 8] ^ (1 << i % 8));
    if (!faultOf([&] { readPly(folder.write("bad.ply", damaged), {}); }).empty()) ++refused;
  }
  REQUIRE(refused > 10);
}

// ---- Simple shapes

TEST_CASE("scenes: makeRectangle creates a transformed rectangle") {
  const TriangleMesh mesh = makeRectangle({});
  REQUIRE(areaOf(mesh) == Approx(4));
  for (std::size_t i = 0; i < 4; ++i) {
    REQUIRE(mesh.uvs[i] == Vec2((mesh.positions[i].head<2>() + Vec2(1, 1)) / 2));
    REQUIRE(mesh.normals[i] == Vec3::UnitZ());
  }
  requireNear(normalOf(mesh, 0), Vec3::UnitZ());
  requireNear(normalOf(mesh, 1), Vec3::UnitZ());
  requireNear(normalOf(makeRectangle(placed(mirror())), 0), Vec3::UnitZ());
  MeshOptions flipped;
  flipped.flipNormals = true;
  requireNear(normalOf(makeRectangle(flipped), 1), -Vec3::UnitZ());
}

TEST_CASE("scenes: makeCube creates a transformed cube") {
  for (const bool mirrored : {false, true}) {
    MeshOptions options = placed(mirrored ? mirror() : Eigen::Affine3f::Identity());
    options.faceNormals = mirrored;
    const TriangleMesh mesh = makeCube(options);
    REQUIRE(mesh.triangles.size() == 12);
    REQUIRE(areaOf(mesh) == Approx(24));
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const std::uint32_t corner = mesh.triangles[i][0];
      requireNear(normalOf(mesh, i), mesh.normals[corner]);
      REQUIRE(normalOf(mesh, i).dot(mesh.positions[corner]) == Approx(1));
    }
  }
}

TEST_CASE("scenes: a cube has the texture coordinates of Mitsuba's") {
  const TriangleMesh mesh = makeCube({});
  const auto uvAt = [&](const Vec3& normal, const Vec3& position) {
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      if (mesh.normals[i] == normal && mesh.positions[i] == position) return mesh.uvs[i];
    return Vec2(-1, -1);
  };
  // One corner of each face at (0, 1), and its neighbour at (1, 1).
  CHECK(uvAt({0, -1, 0}, {1, -1, -1}) == Vec2(0, 1));
  CHECK(uvAt({0, -1, 0}, {1, -1, 1}) == Vec2(1, 1));
  CHECK(uvAt({0, 1, 0}, {1, 1, -1}) == Vec2(0, 1));
  CHECK(uvAt({0, 1, 0}, {-1, 1, -1}) == Vec2(1, 1));
  CHECK(uvAt({1, 0, 0}, {1, -1, -1}) == Vec2(0, 1));
  CHECK(uvAt({1, 0, 0}, {1, 1, -1}) == Vec2(1, 1));
  CHECK(uvAt({0, 0, 1}, {1, -1, 1}) == Vec2(0, 1));
  CHECK(uvAt({0, 0, 1}, {1, 1, 1}) == Vec2(1, 1));
  CHECK(uvAt({-1, 0, 0}, {-1, -1, 1}) == Vec2(0, 1));
  CHECK(uvAt({-1, 0, 0}, {-1, 1, 1}) == Vec2(1, 1));
  CHECK(uvAt({0, 0, -1}, {1, 1, -1}) == Vec2(0, 1));
  CHECK(uvAt({0, 0, -1}, {1, -1, -1}) == Vec2(1, 1));
}

TEST_CASE("scenes: makeDisk creates a transformed disk") {
  const Eigen::Affine3f transform =
      Eigen::Translation3f(1, 2, 3) * Eigen::AngleAxisf(0.7f, Vec3(1, 2, 2) / 3) * Eigen::Scaling(2.0f, 2.0f, 5.0f);
  const Disk disk = makeDisk(placed(transform));
  requireNear(disk.centre, Vec3(1, 2, 3));
  REQUIRE(disk.u.norm() == Approx(2));
  requireNear(Vec3(disk.u.cross(disk.v) / 4), Vec3(transform.linear().col(2) / 5));
  REQUIRE_FALSE(disk.flipped);
  // Under mirroring, texture and front stay in place: (u, v) changes its handedness, and `flipped` compensates.
  const Disk mirrored = makeDisk(placed(mirror()));
  requireNear(mirrored.u.cross(mirrored.v), -Vec3::UnitZ());
  REQUIRE(mirrored.flipped);
  MeshOptions flipped;
  flipped.flipNormals = true;
  REQUIRE(makeDisk(flipped).flipped);
  const Disk ellipse = makeDisk(placed(Eigen::Affine3f(Eigen::Scaling(1.0f, 2.0f, 1.0f))));
  requireNear(ellipse.u, Vec3(1, 0, 0));
  requireNear(ellipse.v, Vec3(0, 2, 0));
}

TEST_CASE("scenes: makeSphere creates a transformed sphere") {
  const Eigen::Affine3f transform =
      Eigen::Translation3f(1, 2, 3) * Eigen::AngleAxisf(1.2f, Vec3::UnitY()) * Eigen::Scaling(-3.0f);
  const Sphere sphere = makeSphere({0, 1, 0}, 0.5f, placed(transform));
  requireNear(sphere.centre, Vec3(1, -1, 3));
  REQUIRE(sphere.radius == Approx(1.5f));
  REQUIRE_FALSE(sphere.flipped);
  requireNear(sphere.axes.col(1), Vec3(0, -1, 0));
  REQUIRE((sphere.axes.transpose() * sphere.axes).isIdentity(1e-5f));
  MeshOptions flipped;
  flipped.flipNormals = true;
  REQUIRE(makeSphere(Vec3::Zero(), 1, flipped).flipped);
  REQUIRE_THROWS_AS(makeSphere(Vec3::Zero(), 0, {}), std::runtime_error);
  REQUIRE_THROWS_AS(makeSphere(Vec3::Zero(), 1, placed(Eigen::Affine3f(Eigen::Scaling(1.0f, 1.0f, 1.01f)))),
                    std::runtime_error);
}

TEST_CASE("scenes: makeCylinder creates a transformed cylinder") {
  const Eigen::Affine3f transform =
      Eigen::Translation3f(1, 2, 3) * Eigen::AngleAxisf(1.5707964f, Vec3::UnitX()) * Eigen::Scaling(2.0f, 2.0f, 5.0f);
  const Cylinder cylinder = makeCylinder({0, 0, 1}, {0, 0, 2}, 0.5f, placed(transform));
  requireNear(cylinder.base, Vec3(1, -3, 3));
  requireNear(cylinder.axis, Vec3(0, -5, 0));
  REQUIRE(cylinder.u.norm() == Approx(1));
  REQUIRE(cylinder.v.norm() == Approx(1));
  REQUIRE(cylinder.u.dot(cylinder.v) == Approx(0).margin(1e-6));
  const auto scaled = [](float x, float y, float z) { return placed(Eigen::Affine3f(Eigen::Scaling(x, y, z))); };
  REQUIRE_THROWS_WITH(makeCylinder({0, 0, 0}, {0, 0, 1}, 1, scaled(1, 2, 1)), Contains("circular"));
  REQUIRE_THROWS_WITH(makeCylinder({0, 0, 0}, {1, 0, 1}, 1, scaled(1, 1, 2)), Contains("circular"));
  REQUIRE_THROWS_WITH(makeCylinder({0, 0, 1}, {0, 0, 1}, 1, {}), Contains("two different"));
}

TEST_CASE("scenes: singular and projective and non-finite transforms are rejected") {
  std::array<Eigen::Matrix4f, 3> bad;
  bad.fill(Eigen::Matrix4f::Identity());
  bad[0](2, 2) = 0;
  bad[1](3, 0) = 1;
  bad[2](0, 3) = std::numeric_limits<float>::quiet_NaN();
  for (const Eigen::Matrix4f& matrix : bad) {
    MeshOptions options;
    options.toWorld = matrix;
    REQUIRE_THROWS_WITH(makeCube(options), Contains("transform"));
    REQUIRE_THROWS_WITH(makeDisk(options), Contains("transform"));
    REQUIRE_THROWS_WITH(makeSphere(Vec3::Zero(), 1, options), Contains("transform"));
    REQUIRE_THROWS_WITH(makeCylinder(Vec3::Zero(), Vec3::UnitX(), 1, options), Contains("transform"));
  }
}
