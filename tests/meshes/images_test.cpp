// Properties of image files: encoding, order of pixels, and channels other than colours.

#include <array>

#include <catch2/catch.hpp>

#include <ImfRgbaFile.h>

#include "runtime/image/image.h"
#include "tests/support/scenes_test_tools.h"
#include "tests/support/small_images.h"

namespace lobe {
namespace {

void requireNear(const Rgb& value, const Rgb& expected) {
  INFO(value.transpose() << " is not " << expected.transpose());
  REQUIRE((value - expected).abs().maxCoeff() < 1e-4f);
}

Image readBytes(const std::string& name, const std::string& bytes) {
  const TestFolder folder;
  return readImage(folder.write(name, bytes));
}

std::string faultOfImage(const std::string& bytes) {
  try {
    readBytes("a.hdr", bytes);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

std::string hdr(const std::string& size, const std::string& pixels, const std::string& format = "rgbe") {
  return "#?RADIANCE\nSOFTWARE=test\nFORMAT=32-bit_rle_" + format + "\n\n" + size + "\n" + pixels;
}

/// A pixel whose red is `sixteenths`/16, with green and blue 0.
std::string red(int sixteenths) {
  return {static_cast<char>(sixteenths), 0, 0, static_cast<char>(132)};
}

/// Red values 0 to 5, each once, in the order of storage.
const std::string kSix = red(0) + red(16) + red(32) + red(48) + red(64) + red(80);

}  // namespace

TEST_CASE("materials: HDR images are oriented according to their resolution line") {
  // Expected positions of 0 (first stored), 1 (next) and 3 (first of the second line of three).
  struct Case {
    std::string size;
    int width;
    std::array<int, 2> first, next, line;
  };
  for (const Case& c : {Case{"-Y 2 +X 3", 3, {0, 0}, {1, 0}, {0, 1}}, Case{"-Y 2 -X 3", 3, {2, 0}, {1, 0}, {2, 1}},
                        Case{"+Y 2 +X 3", 3, {0, 1}, {1, 1}, {0, 0}}, Case{"+Y 2 -X 3", 3, {2, 1}, {1, 1}, {2, 0}},
                        Case{"+X 2 -Y 3", 2, {0, 0}, {0, 1}, {1, 0}}, Case{"-X 2 -Y 3", 2, {1, 0}, {1, 1}, {0, 0}},
                        Case{"+X 2 +Y 3", 2, {0, 2}, {0, 1}, {1, 2}}, Case{"-X 2 +Y 3", 2, {1, 2}, {1, 1}, {0, 2}}}) {
    CAPTURE(c.size);
    const Image image = readBytes("a.hdr", hdr(c.size, kSix));
    REQUIRE(image.width == c.width);
    REQUIRE(image.height == 6 / c.width);
    CHECK(image.at(c.first[0], c.first[1]).x() == 0.0f);
    CHECK(image.at(c.next[0], c.next[1]).x() == 1.0f);
    CHECK(image.at(c.line[0], c.line[1]).x() == 3.0f);
  }
}

TEST_CASE("materials: HDR images with both kinds of run lengths and line endings") {
  // 9 pixels: 1, then eight times 2.
  const std::string old = red(16) + red(32) + std::string("\1\1\1\7", 4);
  // New format: the line's length, then red as 1 literal and a run of 8, green and blue as runs of 0, exponents as a
  // run.
  const std::string coded("\2\2\0\11\1\20\210\40\211\0\211\0\211\204", 14);
  for (const std::string& pixels : {old, coded}) {
    const Image image = readBytes("a.hdr", hdr("-Y 1 +X 9", pixels));
    requireNear(image.at(0, 0), Rgb(1, 0, 0));
    for (int x = 1; x < 9; ++x) requireNear(image.at(x, 0), Rgb(2, 0, 0));
  }
  // Two consecutive run lengths form one number: 1 + 256 times the previous pixel.
  const Image longRun = readBytes("a.hdr", hdr("-Y 1 +X 258", red(16) + std::string("\1\1\1\1\1\1\1\1", 8)));
  requireNear(longRun.at(257, 0), Rgb(1, 0, 0));
  const Image windows = readBytes("a.hdr", "#?RGBE\r\nFORMAT=32-bit_rle_rgbe\r\n\r\n-Y 2 +X 3\r\n" + kSix);
  CHECK(windows.at(2, 1).x() == 5.0f);
  CHECK_THAT(faultOfImage(hdr("-Y 1 +X 9", red(16) + std::string("\1\1\1\11", 4))),
             Catch::Contains("longer than its scanline"));
}

TEST_CASE("materials: HDR images in XYZ are converted to RGB") {
  // The white point of the primaries with a luminance of 1.
  const Image image = readBytes("a.hdr", hdr("-Y 1 +X 1", std::string("\171\200\213\201", 4), "xyze"));
  INFO(image.at(0, 0).transpose());
  CHECK(image.at(0, 0).isApprox(grey(1.0f), 0.02f));
  // Y only: the green column of the matrix with negative values clamped.
  requireNear(readBytes("a.hdr", hdr("-Y 1 +X 1", std::string("\0\200\0\201", 4), "xyze")).at(0, 0),
              Rgb(0, 1.875991f, 0));
}

TEST_CASE("materials: invalid HDR images are rejected with the reason") {
  CHECK_THAT(faultOfImage(hdr("-Y 1 +X 1", red(1), "luv")), Catch::Contains("\"32-bit_rle_luv\"; supported are"));
  CHECK_THAT(faultOfImage(hdr("-Y 1 +Y 1", red(1))), Catch::Contains("same axis twice"));
  CHECK_THAT(faultOfImage(hdr("-Y 1 by 1", red(1))), Catch::Contains("found \"by 1\""));
  CHECK_THAT(faultOfImage(hdr("-Y 9999999 +X 99999999", red(1))), Catch::Contains("over the limit of 2^27 pixels"));
  CHECK_THAT(faultOfImage(hdr("-Y 10000 +X 10000", red(1))), Catch::Contains("10000x10000 pixels in a file of "));
  CHECK_THAT(faultOfImage(hdr("-Y 2 +X 3", kSix.substr(0, 23))), Catch::Contains("unexpected end of file"));
  CHECK_THAT(faultOfImage("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"), Catch::Contains("unexpected end of file"));
}

TEST_CASE("materials: the gAMA chunk of a PNG is used on request unless the file has an sRGB chunk") {
  const TestFolder folder;
  const auto png = [](const std::string& chunks) { return rowPng("\x80\x80\x80", 3, chunks); };
  const auto value = [&](const std::string& bytes, Encoding::Kind kind) {
    return readImage(folder.write("b.png", bytes), {kind, 1.0f}).at(0, 0).x();
  };
  const float srgb = 0.2158605f, tagged = 128 / 255.0f;
  const std::string linear = chunk("gAMA", bigEndian(100000));
  CHECK(value(png(linear), Encoding::Kind::tagged) == Approx(tagged));
  CHECK(value(png(linear), Encoding::Kind::srgb) == Approx(srgb));
  CHECK(value(png(chunk("gAMA", bigEndian(50000))), Encoding::Kind::tagged) == Approx(tagged * tagged));
  CHECK(value(png(""), Encoding::Kind::tagged) == Approx(srgb));
  CHECK(value(png(linear + chunk("sRGB", std::string(1, '\0'))), Encoding::Kind::tagged) == Approx(srgb));
  CHECK(value(png(chunk("gAMA", bigEndian(0))), Encoding::Kind::tagged) == Approx(srgb));
}

TEST_CASE("materials: alpha channels are read separately") {
  const TestFolder folder;
  const std::string colours("\xff\0\0\x33\0\xff\0\xcc", 8);
  const std::string png = folder.write("a.png", rowPng(colours, 4)).string(),
                    opaque = folder.write("b.png", rowPng("\xff\xff\xff", 3)).string();
  // An uncompressed 32-bit TGA stores blue first, starting at the bottom.
  const std::string tga = folder
                              .write("a.tga", std::string("\0\0\2\0\0\0\0\0\0\0\0\0\2\0\1\0\x20\x8", 18) +
                                                  std::string("\0\0\xff\x33\0\xff\0\xcc", 8))
                              .string();
  for (const std::string& path : {png, tga}) {
    CAPTURE(path);
    requireNear(readAlpha(path).at(0, 0), grey(0.2f));
    requireNear(readAlpha(path).at(1, 0), grey(0.8f));
    requireNear(readImage(path).at(0, 0), Rgb(1, 0, 0));
  }
  CHECK_THROWS_WITH(readAlpha(opaque), Catch::Contains("b.png: it has no alpha channel"));
}

TEST_CASE("materials: the alpha channel of an EXR is read") {
  const TestFolder folder;
  const std::string with = (folder.path() / "a.exr").string(), without = (folder.path() / "b.exr").string();
  const Imf::Rgba pixels[] = {{1, 2, 3, 0.25f}, {4, 5, 6, 0.75f}};
  for (const auto& [path, channels] : {std::pair{with, Imf::WRITE_RGBA}, std::pair{without, Imf::WRITE_RGB}}) {
    Imf::RgbaOutputFile file(path.c_str(), 2, 1, channels);
    file.setFrameBuffer(pixels, 1, 2);
    file.writePixels(1);
  }
  requireNear(readAlpha(with).at(0, 0), grey(0.25f));
  requireNear(readAlpha(with).at(1, 0), grey(0.75f));
  CHECK_THROWS_WITH(readAlpha(without), Catch::Contains("b.exr: it has no alpha channel"));
}

}  // namespace lobe
