// Image files of all formats: their pixels, and what is reported about damaged files.

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <ImfChannelList.h>
#include <ImfChromaticities.h>
#include <ImfDeepScanLineOutputFile.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIntAttribute.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfPreviewImageAttribute.h>
#include <ImfStandardAttributes.h>
#include <ImfTileDescription.h>
#include <ImfTiledOutputFile.h>
#include <catch2/catch.hpp>

#include "runtime/image/image.h"
#include "tests/support/meshes_test_tools.h"
#include "tests/support/picture_files.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;
using Catch::Matchers::Contains;

namespace {

using Imath::Box2i;
using Imath::V2i;

/// Pixel (x, y) of channel c is 100·c + 10·y + x, in the coordinates of the data window.
void writeExr(const std::filesystem::path& path, const std::vector<std::string>& channels, Imf::PixelType type,
              const Box2i& display, const Box2i& data, Imf::Compression compression = Imf::ZIP_COMPRESSION) {
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

/// An image of one row.
void writeColours(const std::filesystem::path& path, const std::optional<Imf::Chromaticities>& chromaticities,
                  std::vector<std::array<float, 3>> row) {
  const auto width = static_cast<int>(row.size());
  Imf::Header header(width, 1);
  if (chromaticities) Imf::addChromaticities(header, *chromaticities);
  Imf::FrameBuffer frame;
  constexpr std::array kNames = {"R", "G", "B"};
  for (std::size_t c = 0; c < kNames.size(); ++c) {
    header.channels().insert(kNames[c], Imf::Channel(Imf::FLOAT));
    frame.insert(kNames[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(&row[0][c]), sizeof(row[0]), 0));
  }
  Imf::OutputFile file(path.c_str(), header);
  file.setFrameBuffer(frame);
  file.writePixels(1);
}

Box2i box(int left, int top, int right, int bottom) {
  return {V2i(left, top), V2i(right, bottom)};
}

/// 2×2 pixels: black, a grey of code 128; red, white.
const std::vector<std::uint8_t> kCodes = {0, 0, 0, 128, 128, 128, 255, 0, 0, 255, 255, 255};

}  // namespace

TEST_CASE("materials: 8-bit images are decoded with the requested encoding") {
  const Folder folder;
  for (const std::string type : {"png", "bmp", "tga"}) {
    CAPTURE(type);
    const Image image = readImage(folder.write("a." + type, pictureFile(type, 2, 2, kCodes)));
    REQUIRE(image.width == 2);
    REQUIRE(image.height == 2);
    requireNear(image.at(0, 0), grey(0));
    requireNear(image.at(1, 0), grey(0.2158605f));
    requireNear(image.at(0, 1), Rgb(1, 0, 0));
    requireNear(image.at(1, 1), grey(1));
  }
  const std::filesystem::path png = folder / "a.png";
  requireNear(readImage(png, {Encoding::Kind::linear}).at(1, 0), grey(128 / 255.0f));
  requireNear(readImage(png, {Encoding::Kind::gamma, 2.0f}).at(1, 0), grey(128 * 128 / 65025.0f));
}

TEST_CASE("materials: BMP images whose rows are stored from the top are read") {
  const Folder folder;
  std::string bytes = pictureFile("bmp", 2, 2, kCodes);
  constexpr std::size_t kHeight = 22;
  const std::int32_t height = -2;
  std::memcpy(&bytes[kHeight], &height, sizeof(height));
  const Image image = readImage(folder.write("a.bmp", bytes));
  REQUIRE(image.height == 2);
  requireNear(image.at(0, 1), grey(0));
  requireNear(image.at(0, 0), Rgb(1, 0, 0));
}

TEST_CASE("materials: JPEG and HDR images are read") {
  const Folder folder;
  const std::vector<std::uint8_t> flat(16 * 16 * 3, 128);
  requireNear(readImage(folder.write("a.jpg", pictureFile("jpg", 16, 16, flat))).at(7, 9), grey(0.2158605f), 0.01f);

  std::vector<float> values(16 * 4 * 3);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = 0.25f * static_cast<float>(i / 3 % 16);
  const std::filesystem::path hdr = folder.write("a.hdr", hdrFile(16, 4, values));
  for (const Encoding::Kind kind : {Encoding::Kind::srgb, Encoding::Kind::gamma})
    requireNear(readImage(hdr, {kind, 2.2f}).at(9, 2), grey(2.25f), 0.02f);
}

TEST_CASE("materials: EXR images of half and float with colour and luminance") {
  const Folder folder;
  const std::filesystem::path path = folder / "a.exr";
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
  const std::string fault = faultOfReading([&] { readImage(path); });
  REQUIRE_THAT(fault, Contains("a.exr") && Contains("N.X Z"));
}

TEST_CASE("materials: colours of EXR images are converted from the primaries of the file to Rec. 709") {
  const Folder folder;
  const std::filesystem::path path = folder / "a.exr";
  const auto readRow = [&](const std::optional<Imf::Chromaticities>& chromaticities,
                           const std::vector<std::array<float, 3>>& colours) {
    writeColours(path, chromaticities, colours);
    return readImage(path).pixels;
  };
  using Imath::V2f;
  const V2f d65(0.3127f, 0.3290f);
  const Imf::Chromaticities rec2020(V2f(0.708f, 0.292f), V2f(0.170f, 0.797f), V2f(0.131f, 0.046f), d65);
  const std::vector<std::array<float, 3>> row = {
      {1, 1, 1}, {0.5f, 0.25f, 0.125f}, {0, 1, 0}, {0, 1, -0.5f}, {1e20f, 1e20f, 1e20f}};

  // The matrix of Rec. ITU-R BT.2087.
  Eigen::Matrix3f from2020;
  from2020 << 1.6605f, -0.5876f, -0.0728f, -0.1246f, 1.1329f, -0.0083f, -0.0182f, -0.1006f, 1.1187f;
  const std::vector<Rgb> converted = readRow(rec2020, row);
  requireNear(converted[0], grey(1), 2e-4f);
  requireNear(converted[1], Rgb((from2020 * Vec3(0.5f, 0.25f, 0.125f)).array()), 2e-4f);
  // Outside the gamut, but no fault: the others are negative. A colour that was negative before remains so.
  requireNear(converted[2], Rgb(0, 1.1329f, 0), 2e-4f);
  requireNear(converted[3], Rgb((from2020 * Vec3(0, 1, -0.5f)).array()), 2e-4f);
  CHECK(converted[3].minCoeff() < -0.5f);
  requireNear(Rgb(converted[4] * 1e-20f), grey(1), 2e-4f);

  // The white of ACES is not adapted: its matrix to XYZ in SMPTE ST 2065-1, then that of IEC 61966-2-1.
  const Imf::Chromaticities aces(V2f(0.7347f, 0.2653f), V2f(0, 1), V2f(0.0001f, -0.077f), V2f(0.32168f, 0.33767f));
  Eigen::Matrix3f acesToXyz, xyzTo709;
  acesToXyz << 0.9525523959f, 0, 0.0000936786f, 0.3439664498f, 0.7281660966f, -0.0721325464f, 0, 0, 1.0088251844f;
  xyzTo709 << 3.2406f, -1.5372f, -0.4986f, -0.9689f, 1.8758f, 0.0415f, 0.0557f, -0.2040f, 1.0570f;
  requireNear(readRow(aces, row)[1], Rgb((xyzTo709 * acesToXyz * Vec3(0.5f, 0.25f, 0.125f)).array()), 1e-3f);

  const Imf::Chromaticities xyz(V2f(1, 0), V2f(0, 1), V2f(0, 0), V2f(1 / 3.0f, 1 / 3.0f));
  requireNear(readRow(xyz, {std::array{0.3f, 0.4f, 0.5f}})[0], Rgb((xyzTo709 * Vec3(0.3f, 0.4f, 0.5f)).array()), 1e-3f);

  // Without chromaticities, or with those of Rec. 709, no bit changes.
  for (const std::optional<Imf::Chromaticities>& same :
       {std::optional<Imf::Chromaticities>(), std::optional(Imf::Chromaticities())}) {
    const std::vector<Rgb> unchanged = readRow(same, row);
    for (std::size_t i = 0; i < row.size(); ++i) CHECK((unchanged[i] == Rgb(row[i][0], row[i][1], row[i][2])).all());
  }
  // Nor does it where channels are read as data.
  writeColours(path, rec2020, row);
  CHECK((readChannels(path, {"R", "G", "B"}).value().pixels[1] == Rgb(0.5f, 0.25f, 0.125f)).all());
  CHECK((readChannels(path, {"G", "G", "G"}).value().pixels[1] == 0.25f).all());

  const Imf::Chromaticities flat(V2f(0.3f, 0.3f), V2f(0.4f, 0.4f), V2f(0.5f, 0.5f), d65);
  writeColours(path, flat, row);
  CHECK_THAT(faultOfReading([&] { readImage(path); }), Contains("a.exr: its chromaticities are not those of a colour"));
}

TEST_CASE("materials: an EXR image has the size of its display window") {
  const Folder folder;
  const std::filesystem::path path = folder / "a.exr";
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
  const std::filesystem::path exr = folder / "whole.exr";
  writeExr(exr, {"R", "G", "B"}, Imf::FLOAT, box(0, 0, 40, 40), box(0, 0, 40, 40));
  const std::string bytes = readFile(exr);
  for (const double fraction : {0.01, 0.1, 0.5, 0.9, 0.999}) {
    const std::filesystem::path path =
        folder.write("cut.exr", bytes.substr(0, static_cast<std::size_t>(fraction * bytes.size())));
    CAPTURE(fraction);
    REQUIRE_THAT(faultOfReading([&] { readImage(path); }), Contains("cut.exr") && !Contains("\n"));
  }
  const std::string cut = pictureFile("png", 64, 64, std::vector<std::uint8_t>(64 * 64 * 3, 128)).substr(0, 60);
  REQUIRE_THAT(faultOfReading([&] { readImage(folder.write("cut.png", cut)); }), Contains("cut.png"));
  REQUIRE_THAT(faultOfReading([&] { readImage(folder.write("empty.png", "")); }), Contains("empty.png"));
  REQUIRE_THAT(faultOfReading([&] { readImage(folder.write("text.jpg", "no image")); }), Contains("text.jpg"));
  REQUIRE_THAT(faultOfReading([&] { readImage(folder / "missing.png"); }), Contains("missing.png: no such file"));
  REQUIRE_THAT(faultOfReading([&] { readImage(folder / "."); }), Contains("not a file"));
}

TEST_CASE("materials: truncated images of all formats are rejected") {
  const Folder folder;
  std::map<std::string, std::string> files = {
      {"coded.hdr", hdrFile(64, 64, std::vector<float>(64 * 64 * 3, 0.5f))},
      {"plain.hdr", hdrFile(4, 400, std::vector<float>(4 * 400 * 3, 0.5f))}};  // too narrow for run lengths
  for (const std::string type : {"png", "jpg", "bmp", "tga"})
    files["a." + type] = pictureFile(type, 64, 64, noiseCodes(64, 64));
  for (const auto& [name, bytes] : files) {
    CAPTURE(name);
    REQUIRE_NOTHROW(readImage(folder.write(name, bytes)));
    for (const double fraction : {0.001, 0.1, 0.5, 0.9}) {
      const std::filesystem::path cut =
          folder.write("cut-" + name, bytes.substr(0, static_cast<std::size_t>(fraction * bytes.size())));
      REQUIRE_THAT(faultOfReading([&] { readImage(cut); }), Contains("cut-"));
    }
  }
}

TEST_CASE("materials: a small EXR file that claims a large image is rejected before memory is allocated") {
  const Folder folder;
  const std::filesystem::path exr = folder / "small.exr";
  writeExr(exr, {"Y"}, Imf::HALF, box(0, 0, 9, 9), box(0, 0, 9, 9));
  std::string bytes = readFile(exr);
  const std::size_t window = bytes.find("dataWindow") + std::strlen("dataWindow.box2i.size");
  const std::int32_t right = 9999999;
  std::memcpy(&bytes[window + 2 * sizeof(right)], &right, sizeof(right));
  REQUIRE_THAT(faultOfReading([&] { readImage(folder.write("claim.exr", bytes)); }),
               Contains("claim.exr: 10000000x10 pixels in a file of ") &&
                   Contains(" are over the limit of 2000 pixels per byte"));
}

TEST_CASE("materials: a display window far larger than the data window of an EXR file is rejected") {
  const Folder folder;
  const std::filesystem::path path = folder / "a.exr";
  writeExr(path, {"R", "G", "B"}, Imf::FLOAT, box(0, 0, 11584, 11584), box(0, 0, 39, 39), Imf::NO_COMPRESSION);
  CHECK_THAT(faultOfReading([&] { readImage(path); }),
             Contains("a.exr: its display window of 11585x11585 pixels is over the limit of 2^26 pixels or 16 times "
                      "those of the data window, which has 40x40"));
  writeExr(path, {"Y"}, Imf::HALF, box(0, 0, 1999, 999), box(0, 0, 0, 0));
  CHECK(readImage(path).width == 2000);
}

TEST_CASE("materials: EXR files with faults that do not concern their pixels are read, and deep ones are not") {
  const Folder folder;
  Imf::Header header(2, 1);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  const std::array<float, 2> values{1, 2};
  const auto write = [&](const std::string& name) {
    Imf::FrameBuffer frame;
    frame.insert("Y", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())), 4, 8));
    Imf::OutputFile file((folder / name).c_str(), header);
    file.setFrameBuffer(frame);
    file.writePixels(1);
  };
  header.insert("chunkCount", Imf::IntAttribute(7));
  header.insert("version", Imf::IntAttribute(2));
  header.insert("preview", Imf::PreviewImageAttribute(Imf::PreviewImage(0, 0)));
  write("a.exr");
  CHECK(readImage(folder / "a.exr").at(1, 0).x() == 2);

  Imf::Header deep(2, 1);
  deep.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  deep.setType(Imf::DEEPSCANLINE);
  deep.compression() = Imf::NO_COMPRESSION;
  { const Imf::DeepScanLineOutputFile file((folder / "deep.exr").c_str(), deep); }
  CHECK_THAT(faultOfReading([&] { readImage(folder / "deep.exr"); }), Contains("deep EXR images are not supported"));
}

TEST_CASE("materials: the blocks in which an EXR file is compressed are limited in size") {
  const Folder folder;
  const std::filesystem::path exr = folder / "small.exr";
  const auto replace = [](std::string& bytes, const std::string& attribute, std::size_t at, std::int32_t value) {
    std::memcpy(&bytes[bytes.find(attribute) + attribute.size() + sizeof(std::int32_t) + at], &value, sizeof(value));
  };
  const auto fault = [&](const std::string& bytes) {
    return faultOfReading([&] { readImage(folder.write("a.exr", bytes)); });
  };
  writeExr(exr, {"Y"}, Imf::FLOAT, box(0, 0, 9, 9), box(0, 0, 9, 9), Imf::NO_COMPRESSION);
  std::string wide = readFile(exr);
  replace(wide, {"dataWindow\0box2i\0", 17}, 8, 99999);
  const std::string method{"compression\0compression\0", 24};
  wide[wide.find(method) + method.size() + sizeof(std::int32_t)] = static_cast<char>(Imf::DWAB_COMPRESSION);
  CHECK_THAT(fault(wide),
             Contains("a.exr: its lines or tiles are compressed in blocks of 102400000 bytes, which is over "
                      "the limit of 67108864 bytes"));

  Imf::Header header(8, 8);
  header.channels().insert("Y", Imf::Channel(Imf::HALF));
  header.setTileDescription(Imf::TileDescription(8, 8));
  std::vector<half> pixels(64);
  Imf::FrameBuffer frame;
  frame.insert("Y", Imf::Slice(Imf::HALF, reinterpret_cast<char*>(pixels.data()), 2, 16));
  {
    Imf::TiledOutputFile file(exr.c_str(), header);
    file.setFrameBuffer(frame);
    file.writeTile(0, 0);
  }
  std::string tall = readFile(exr);
  CHECK(fault(tall).empty());
  replace(tall, {"tiles\0tiledesc\0", 15}, 4, 1 << 20);
  CHECK_THAT(fault(tall), Contains("a.exr: its lines or tiles are compressed in blocks of 100663296 bytes"));

  // A real file of few bytes with long lines and the largest blocks.
  writeExr(exr, {"R", "G", "B"}, Imf::HALF, box(0, 0, 16383, 0), box(0, 0, 16383, 0), Imf::DWAB_COMPRESSION);
  CHECK(readImage(exr).width == 16384);
}

TEST_CASE("materials: flipped bits in an EXR file never crash") {
  const Folder folder;
  const std::filesystem::path exr = folder / "whole.exr";
  writeExr(exr, {"R", "G", "B"}, Imf::HALF, box(0, 0, 9, 9), box(0, 0, 9, 9));
  const std::string bytes = readFile(exr);
  int refused = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ (1 << i % 8));
    const std::string fault = faultOfReading([&] { readImage(folder.write("bad.exr", damaged)); });
    if (!fault.empty()) ++refused;
    if (!fault.empty()) REQUIRE_THAT(fault, Contains("bad.exr"));
  }
  REQUIRE(refused > 10);
}
