// PNG files of all kinds, and damaged ones.

#include <fstream>
#include <initializer_list>
#include <string>
#include <vector>

#include "runtime/image/image.h"
#include "tests/support/small_images.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;
using Catch::Contains;

namespace {

std::string bytes(std::initializer_list<int> values) {
  std::string all;
  for (const int value : values) all += static_cast<char>(value);
  return all;
}

/// A file in a temporary folder.
class PngOnDisk {
 public:
  explicit PngOnDisk(const std::string& content) { std::ofstream(path_, std::ios::binary) << content; }

  /// The values as they are stored, scaled to [0, 1].
  Image colours() const { return readImage(path_, {Encoding::Kind::linear}); }
  Image alpha() const { return readAlpha(path_); }

 private:
  Folder folder_;
  std::filesystem::path path_ = folder_ / "a.png";
};

void checkPixels(const Image& image, const std::vector<Rgb>& expected) {
  REQUIRE(image.pixels.size() == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    INFO("pixel " << i << " is " << image.pixels[i].transpose() << ", not " << expected[i].transpose());
    CHECK((image.pixels[i] - expected[i]).abs().maxCoeff() < 1e-6f);
  }
}

/// The message of the exception that reading the file throws; empty if there is none.
std::string faultOf(const std::string& content) {
  try {
    PngOnDisk(content).colours();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return {};
}

/// Two 8-bit pixels.
std::string smallPng(const std::string& chunks = "") {
  return rowPng("abcdef", 3, chunks);
}

/// Changes the lowest bit of the checksum of the first chunk of this name.
std::string withWrongChecksum(std::string file, const std::string& name, std::size_t dataSize) {
  char& last = file.at(file.find(name) + name.size() + dataSize + 3);
  last = static_cast<char>(last ^ 1);
  return file;
}

}  // namespace

TEST_CASE("image: PNG files of all colour types and depths have the stored values") {
  using Colours = PngColours;
  /// An image of two pixels in a row.
  struct Case {
    int depth;
    Colours type;
    std::string row, chunks;
    std::vector<Rgb> colours;
    std::vector<Rgb> alpha;  ///< empty: none
  };
  const std::vector<Rgb> redBlue = {Rgb(1, 0, 0.2f), Rgb(0, 0.4f, 1)}, greys = {grey(0.2f), grey(0.8f)},
                         doubled = {grey(0.4f), grey(0.8f)}, clear = {grey(0), grey(1)}, none;
  const float fine = 32769 / 65535.0f;  // not a multiple of 1/255
  const std::string palette = chunk("PLTE", bytes({255, 0, 51, 0, 102, 255})),
                    redBlueRow = bytes({0, 255, 0, 51, 0, 102, 255});
  for (const Case& c : {
           Case{8, Colours::rgb, redBlueRow, "", redBlue, none},
           Case{8, Colours::rgb, redBlueRow, chunk("tRNS", bytes({0, 255, 0, 0, 0, 51})), redBlue, clear},
           Case{8, Colours::rgba, bytes({0, 255, 0, 51, 102, 0, 102, 255, 204}), "", redBlue, doubled},
           Case{8, Colours::grey, bytes({0, 51, 204}), "", greys, none},
           Case{8, Colours::greyAlpha, bytes({0, 51, 0, 204, 255}), "", greys, clear},
           Case{1, Colours::grey, bytes({0, 0x40}), "", clear, none},
           Case{4, Colours::grey, bytes({0, 0x3c}), "", greys, none},
           Case{8, Colours::palette, bytes({0, 0, 1}), palette, redBlue, none},
           Case{2, Colours::palette, bytes({0, 0x10}), palette + chunk("tRNS", bytes({102, 204})), redBlue, doubled},
           Case{2, Colours::palette, bytes({0, 0x10}), palette + chunk("tRNS", bytes({0})), redBlue, clear},
           Case{16,
                Colours::rgb,
                bytes({0, 0x80, 1, 0, 0, 255, 255, 0, 0, 51, 51, 0x80, 1}),
                "",
                {Rgb(fine, 0, 1), Rgb(0, 0.2f, fine)},
                none},
           Case{16, Colours::greyAlpha, bytes({0, 51, 51, 0x80, 1, 204, 204, 0, 0}), "", greys, {grey(fine), grey(0)}},
       }) {
    CAPTURE(c.depth, static_cast<int>(c.type));
    const PngOnDisk file(pngFile({2, 1, c.depth, c.type}, deflated(c.row), c.chunks));
    checkPixels(file.colours(), c.colours);
    if (c.alpha.empty()) CHECK_THROWS_WITH(file.alpha(), Contains("a.png: it has no alpha channel"));
    if (!c.alpha.empty()) checkPixels(file.alpha(), c.alpha);
  }
}

TEST_CASE("image: interlaced PNG files are read") {
  // The seven passes of a 3x3 image, two of which are empty. Codes are 25 times the index of the pixel.
  const std::string rows = bytes({0, 0, 0, 50, 0, 150, 200, 0, 25, 0, 175, 0, 75, 100, 125});
  std::vector<Rgb> expected;
  for (int i = 0; i < 9; ++i) expected.push_back(grey(25 * i / 255.0f));
  checkPixels(PngOnDisk(pngFile({3, 3, 8, PngColours::grey, true}, deflated(rows))).colours(), expected);
}

TEST_CASE("image: limits of libpng do not apply") {
  // More than a million pixels in a row, and a chunk of more than 8 MB.
  const PngOnDisk wide(pngFile({1'600'000, 1, 1, PngColours::grey}, deflated('\0' + std::string(200'000, '\x55'))));
  CHECK(wide.colours().at(1'599'999, 0).x() == 1);
  CHECK(faultOf(smallPng(chunk("prIv", std::string(9'000'000, '\0')))).empty());
}

TEST_CASE("image: PNG files that declare too small a window for their compressed data are read") {
  std::string row(1, '\0');
  for (unsigned i = 0; i < 1024; ++i) row += static_cast<char>(i * i / 7);
  std::string stream = deflated(row + row);
  stream.replace(0, 2, "\x08\x1d");  // 256 bytes
  const Image image = PngOnDisk(pngFile({1024, 2, 8, PngColours::grey}, stream)).colours();
  for (int x = 0; x < 1024; ++x) REQUIRE((image.at(x, 0) == image.at(x, 1)).all());
}

TEST_CASE("image: PNG files with a wrong checksum are rejected") {
  const std::string text = chunk("tEXt", "a");
  CHECK(faultOf(smallPng(text)).empty());
  CHECK_THAT(faultOf(withWrongChecksum(smallPng(), "IHDR", 13)), Contains("a.png: damaged image (IHDR: CRC error)"));
  CHECK_THAT(faultOf(withWrongChecksum(smallPng(), "IDAT", deflated('\0' + std::string("abcdef")).size())),
             Contains("a.png: damaged image (IDAT: CRC error)"));
  CHECK_THAT(faultOf(withWrongChecksum(smallPng(), "IEND", 0)), Contains("a.png: damaged image (IEND: CRC error)"));
  CHECK_THAT(faultOf(withWrongChecksum(smallPng(text), "tEXt", 1)), Contains("a.png: damaged image (tEXt: CRC error)"));
}

TEST_CASE("image: PNG files are rejected wherever they end too early") {
  const std::string rows = bytes({0, 0, 0, 1, 0, 2, 3, 0, 4, 0, 5, 0, 6, 7, 8});
  for (const std::string& file : {smallPng(), pngFile({3, 3, 8, PngColours::grey, true}, deflated(rows))}) {
    REQUIRE(faultOf(file).empty());
    for (std::size_t size = 8; size < file.size(); ++size) {
      CAPTURE(size);
      CHECK_THAT(faultOf(file.substr(0, size)), Contains("a.png: damaged image (it ends too early)"));
    }
  }
}

TEST_CASE("image: invalid PNG files are rejected") {
  const std::string row = deflated(bytes({0, 1, 2, 3, 4, 5, 6}));
  std::string apple = smallPng();
  apple.insert(8, chunk("CgBI", bytes({0x50, 0, 0x20, 0x02})));
  for (const std::string& file :
       {apple, pngFile({2, 1, 4, PngColours::rgb}, row), pngFile({0, 1, 8, PngColours::rgb}, row),
        pngFile({2, 1, 8, PngColours::palette}, row), pngFile({2, 2, 8, PngColours::rgb}, row),
        pngFile({2, 1, 8, PngColours::rgb}, "no stream"), smallPng(chunk("ABCD", ""))})
    CHECK_THAT(faultOf(file), Contains("a.png: damaged image ("));
}

TEST_CASE("image: PNG files that claim a huge size are rejected before memory is allocated") {
  const auto fault = [](std::uint32_t width, std::uint32_t height) {
    return faultOf(pngFile({width, height, 8, PngColours::rgb}, deflated("abc")));
  };
  CHECK_THAT(fault(20000, 20000), Contains("a.png: its size of 20000x20000 pixels is over the limit of 2^27 pixels"));
  CHECK_THAT(fault(0x7fffffff, 1), Contains("its size of 2147483647x1 pixels is over the limit"));
  CHECK_THAT(fault(1, 0x7fffffff), Contains("its size of 1x2147483647 pixels is over the limit"));
  CHECK_THAT(fault(10000, 10000), Contains("a.png: 10000x10000 pixels in a file of "));
}

TEST_CASE("image: PNG files have at most as many pixels per byte as their depth allows") {
  const std::string rows(5000 * (1 + 5000 / 8), '\0');
  CHECK(PngOnDisk(pngFile({5000, 5000, 1, PngColours::grey}, deflated(rows))).colours().width == 5000);
  const auto fault = [](int depth, PngColours colours, std::size_t size) {
    return faultOf(pngFile({5000, 5000, depth, colours}, std::string(size, 'a')));
  };
  const std::string tooSmall = "are over the limit of ";
  CHECK_THAT(fault(1, PngColours::grey, 2000), Contains(tooSmall + "8256 pixels per byte"));
  CHECK_THAT(fault(8, PngColours::rgb, 50000), Contains(tooSmall + "344 pixels per byte"));
  CHECK_THAT(fault(16, PngColours::rgba, 100000), Contains(tooSmall + "129 pixels per byte"));
  CHECK_THAT(fault(8, PngColours::rgb, 100000), Contains("a.png: damaged image ("));
}
