// Image files with damaged or false headers.

#include <cstdint>
#include <string>

#include <zlib.h>
#include <catch2/catch.hpp>

#include "runtime/image/image_limits.h"
#include "runtime/image/image_output.h"
#include "tests/support/picture_files.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using Catch::Contains;

namespace {

void putBigEndian(std::string& bytes, std::size_t at, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes[at++] = static_cast<char>(value >> shift & 0xff);
}

/// A small PNG whose header gives this size, with a correct checksum.
std::string pngThatClaims(std::uint32_t width, std::uint32_t height) {
  const test::Folder folder;
  writeImage(folder / "a.png", Image(3, 2));
  std::string bytes = test::readFile(folder / "a.png");
  // After the signature of 8 bytes, the chunk IHDR: length, name, width, height and 5 more bytes, checksum.
  constexpr std::size_t kName = 12, kWidth = 16, kHeight = 20, kChecksum = 29;
  REQUIRE(bytes.substr(kName, 4) == "IHDR");
  putBigEndian(bytes, kWidth, width);
  putBigEndian(bytes, kHeight, height);
  const uLong checksum = crc32(0, reinterpret_cast<const Bytef*>(&bytes[kName]), kChecksum - kName);
  putBigEndian(bytes, kChecksum, static_cast<std::uint32_t>(checksum));
  return bytes;
}

std::string jpegSegment(char marker, const std::string& content) {
  const std::size_t length = content.size() + 2;
  return std::string("\xff") + marker + static_cast<char>(length / 256) + static_cast<char>(length % 256) + content;
}

/// A grey progressive JPEG of 8×8 pixels: a scan of the means, and scans that add nothing to them.
std::string progressiveJpeg(int scans) {
  const std::string oneCode = '\1' + std::string(15, '\0');
  std::string bytes = "\xff\xd8" + jpegSegment('\xdb', '\0' + std::string(64, '\1')) +
                      jpegSegment('\xc2', {"\x8\0\x8\0\x8\1\1\x11\0", 9}) + jpegSegment('\xc4', '\0' + oneCode + '\0') +
                      jpegSegment('\xc4', '\x10' + oneCode + '\xe0') + jpegSegment('\xda', {"\1\1\0\0\0\0", 6}) +
                      '\x7f';
  for (int i = 0; i < scans; ++i) bytes += jpegSegment('\xda', {"\1\1\0\1\1\0", 6}) + std::string("\0\1", 2);
  return bytes + "\xff\xd9";
}

std::string littleEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 0xff);
  return bytes;
}

/// A small EXR whose first attribute claims this size.
std::string exrWithAttribute(const std::string& name, const std::string& type, std::uint32_t size,
                             const std::string& value) {
  constexpr std::size_t kMagicAndVersion = 8;
  const test::Folder folder;
  writeImage(folder / "a.exr", Image(3, 2));
  return test::readFile(folder / "a.exr")
      .insert(kMagicAndVersion, name + '\0' + type + '\0' + littleEndian(size) + value);
}

Image readBytes(const std::string& name, const std::string& bytes) {
  const test::Folder folder;
  return readImage(folder.write(name, bytes));
}

}  // namespace

TEST_CASE("render: a small PNG that claims a large size is rejected") {
  CHECK(readBytes("a.png", pngThatClaims(3, 2)).width == 3);
  CHECK_THROWS_WITH(
      readBytes("a.png", pngThatClaims(10000, 10000)),
      Contains("a.png: 10000x10000 pixels in a file of ") && Contains(" are over the limit of 344 pixels per byte"));
  CHECK_THROWS_WITH(readBytes("a.png", pngThatClaims(16000, 16000)),
                    Contains("a.png: its size of 16000x16000 pixels is over the limit of 2^27 pixels"));
  CHECK_THROWS_WITH(readBytes("a.png", pngThatClaims(0xffffffff, 0xffffffff)), Contains("a.png: "));
}

TEST_CASE("render: a JPEG with more than 500 scans is rejected") {
  CHECK(readBytes("a.jpg", progressiveJpeg(10)).width == 8);
  CHECK_THROWS_WITH(readBytes("a.jpg", progressiveJpeg(600)),
                    Contains("a.jpg: damaged image (Progressive JPEG image has more than 500 scans"));
}

TEST_CASE("render: the pixels of all images of a scene are limited") {
  constexpr std::uintmax_t kLimit = 134217728;
  const test::Folder folder;
  PixelBudget budget;
  budget.addFile(folder / "none.png");
  for (int i = 0; i < 2; ++i) budget.addFile(folder.write("a.png", std::string(200000, 'a')));
  budget.addImage(kLimit);
  CHECK(!budget.isExceeded());
  CHECK_THROWS_WITH(budget.addImage(1),
                    "the images of the scene have more than 134217728 pixels together, the limit for "
                    "200000 bytes of image files");
  CHECK(budget.isExceeded());
  budget.addFile(folder.write("b.png", std::string(100000, 'b')));
  CHECK_NOTHROW(budget.addImage(300000 * 500 - kLimit - 1));
  CHECK_THROWS_WITH(budget.addImage(1), Contains("more than 150000000 pixels together"));
}

TEST_CASE("render: empty images are rejected") {
  // A BMP with the older header of 12 bytes and a width of 0.
  const std::string bytes{"BM\x1a\0\0\0\0\0\0\0\x1a\0\0\0\x0c\0\0\0\0\0\3\0\1\0\x18\0", 26};
  CHECK_THROWS_WITH(readBytes("a.bmp", bytes), Contains("a.bmp: an image of 0x3 pixels is empty"));
}

TEST_CASE("render: an EXR whose attribute claims more bytes than the file has is rejected") {
  const test::Folder folder;
  writeImage(folder / "a.exr", Image(3, 2), {{"seed", 1.0}});
  std::string bytes = test::readFile(folder / "a.exr");
  CHECK(readBytes("a.exr", bytes).width == 3);
  const std::string attribute{"seed\0double\0", 12};
  const std::size_t size = bytes.find(attribute) + attribute.size();
  REQUIRE(bytes[size] == sizeof(double));
  bytes[size + 3] = 0x65;  // the highest byte of four
  folder.write("a.exr", bytes);
  const std::string fault = "a.exr: damaged EXR file (Attribute 'seed': Invalid size 1694498824";
  CHECK_THROWS_WITH(readImage(folder / "a.exr"), Contains(fault));
  CHECK_THROWS_WITH(readAttributes(folder / "a.exr"), Contains(fault));
}

TEST_CASE("render: an EXR with a preview that is larger than the file is rejected") {
  constexpr std::uint32_t kSide = 23000;
  const std::string sides = littleEndian(kSide) + littleEndian(kSide);
  CHECK_THROWS_WITH(readBytes("a.exr", exrWithAttribute("preview", "preview", 8 + 4 * kSide * kSide, sides)),
                    Contains("a.exr: damaged EXR file (Attribute 'preview', type 'preview': "
                             "Invalid size for preview 23000 x 23000)"));
}

TEST_CASE("render: an EXR with a large attribute is rejected also if its name is similar to that of the preview") {
  CHECK_THROWS_WITH(readBytes("a.exr", exrWithAttribute("xpreview", "string", 0x7fffffff, "")),
                    Contains("a.exr: damaged EXR file (Attribute 'xpreview', type 'string': Invalid size 2147483647)"));
}

TEST_CASE("render: an EXR with an attribute without a type is rejected, because those after it are not checked") {
  CHECK_THROWS_WITH(readBytes("a.exr", exrWithAttribute("x", "", 0, "")),
                    Contains("a.exr: damaged EXR file (Invalid empty string encountered parsing attribute type for "
                             "attribute 'x')"));
}

TEST_CASE("render: a JPEG with damaged Huffman tables is rejected or read, but never crashes") {
  const std::string bytes = test::pictureFile("jpg", 17, 13, test::noiseCodes(17, 13));
  CHECK(readBytes("a.jpg", bytes).height == 13);
  const std::size_t marker = bytes.find("\xff\xc4");
  REQUIRE(marker != std::string::npos);
  // After the marker and the length of the segment: the number of the first table, and how many codes it has of each of
  // 16 lengths.
  constexpr std::size_t kLengths = 16;
  const std::size_t table = marker + 4;
  std::string full = bytes;
  full.replace(table + 1, kLengths, kLengths, '\xff');
  CHECK_THROWS_WITH(readBytes("a.jpg", full), Contains("a.jpg: damaged image"));
  const std::size_t length =
      static_cast<std::uint8_t>(bytes[marker + 2]) * 256u + static_cast<std::uint8_t>(bytes[marker + 3]);
  for (std::size_t i = marker + 2; i < marker + 2 + length; ++i) {
    std::string damaged = bytes;
    damaged[i] = '\xff';
    CAPTURE(i);
    try {
      const Image image = readBytes("a.jpg", damaged);
      CHECK(image.width == 17);
    } catch (const std::runtime_error& error) {
      CHECK_THAT(error.what(), Contains("a.jpg: ") && !Contains("\n"));
    }
  }
}
