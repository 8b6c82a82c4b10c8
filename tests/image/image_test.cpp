// Error metrics and image files.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include <ImfChannelList.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>

#include "runtime/core/random.h"
#include "runtime/image/error_map.h"
#include "runtime/image/error_metrics.h"
#include "runtime/image/image_output.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

std::string bytesOf(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

Image gradient(int width, int height) {
  Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at(x, y) = Rgb(x / 7.0f, y / 5.0f, 1e-3f * x * y);
  return image;
}

}  // namespace

TEST_CASE("render: error metrics of simple images") {
  Image reference(10, 10, grey(0.5f));
  SECTION("equal") {
    const ErrorMetrics m = compareImages(reference, reference);
    CHECK(m.mse == 0);
    CHECK(m.relmse == 0);
    CHECK(m.meanRatio == 1);
    CHECK(m.nonfinite == 0);
  }
  SECTION("brighter by 0.1") {
    const ErrorMetrics m = compareImages(reference, Image(10, 10, grey(0.6f)));
    CHECK(m.mse == Approx(0.01));
    CHECK(m.relmse == Approx(0.01 / 0.26));
    CHECK(m.relmseDrop1 == Approx(0.01 / 0.26));
    CHECK(m.meanRatio == Approx(1.2));
  }
  SECTION("one bad pixel in a hundred") {
    Image image = reference;
    image.at(3, 4).x() = 3.5f;
    const ErrorMetrics m = compareImages(reference, image);
    CHECK(m.mse == Approx(9.0 / 300));
    CHECK(m.relmse == Approx(9.0 / 0.26 / 300));
    CHECK(m.relmseDrop01 == Approx(m.relmse));  // a thousandth of a hundred pixels is none
    CHECK(m.relmseDrop1 == 0);
  }
  SECTION("not finite") {
    Image image = reference;
    image.at(0, 0).y() = kNan;
    image.at(1, 0).z() = std::numeric_limits<float>::infinity();
    image.at(2, 0) = grey(0.7f);
    const ErrorMetrics m = compareImages(reference, image);
    CHECK(m.nonfinite == 2);
    CHECK(m.mse == Approx(0.04 / 98));
    CHECK(m.meanRatio == Approx((97 * 0.5 + 0.7) / (98 * 0.5)));
    CHECK(std::isnan(relativeErrors(reference, image)[0]));
  }
  SECTION("black reference") {
    CHECK(std::isnan(compareImages(Image(2, 2), Image(2, 2)).meanRatio));
  }
  SECTION("sizes") {
    CHECK_THROWS_WITH(compareImages(reference, Image(10, 9)), "the image has 10x9 pixels, the reference 10x10");
    CHECK_THROWS(compareImages(Image(), Image()));
  }
}

TEST_CASE("render: metrics can leave out a fraction of the worst pixels") {
  Image reference(100, 20, grey(0.0f)), image = reference;
  for (int i = 0; i < 20; ++i) image.pixels[i * 97] = grey(i < 2 ? 10.0f : 1.0f);
  const ErrorMetrics m = compareImages(reference, image);
  CHECK(m.relmse == Approx((2 * 1e4 + 18 * 100) / 2000));
  CHECK(m.relmseDrop01 == Approx(18 * 100.0 / 1998));
  CHECK(m.relmseDrop1 == 0);
}

TEST_CASE("render: the standard error of the mean error is that between blocks") {
  Image reference(kErrorBlock * 4, kErrorBlock, grey(0.0f)), image = reference;
  // Relative errors of 100, 200, 300 and 400 in the four blocks.
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const int block = x / kErrorBlock + 1;
      image.at(x, y) = grey(std::sqrt(static_cast<float>(block)));
    }
  const ErrorMetrics m = compareImages(reference, image);
  CHECK(m.relmse == Approx(250));
  // The standard deviation of 100, 200, 300 and 400, over the root of 4.
  CHECK(m.relmseError == Approx(std::sqrt(50000.0 / 3) / 2));
  CHECK(std::isnan(compareImages(Image(kErrorBlock, 2), Image(kErrorBlock, 2)).relmseError));
}

TEST_CASE("render: metrics say what fraction of the error the worst pixels have") {
  Image reference(100, 100, grey(0.0f)), image = reference;
  for (int i = 0; i < 200; ++i) image.pixels[static_cast<std::size_t>(i) * 47] = grey(0.1f);  // an error of 1 each
  image.pixels[5] = grey(1);                                                                  // an error of 100
  const ErrorMetrics m = compareImages(reference, image);
  CHECK(m.worst.fraction001 == Approx(100.0 / 300));
  CHECK(m.worst.fraction01 == Approx((100.0 + 9) / 300));
  CHECK(m.worst.fraction1 == Approx((100.0 + 99) / 300));
  CHECK(compareImages(reference, reference).worst.fraction1 == 0);
}

TEST_CASE("render: fireflies are far above their surroundings and the reference") {
  Image reference(20, 20, grey(0.5f));
  reference.at(3, 3) = grey(20);  // a small lamp
  Image image = reference;
  CHECK(compareImages(reference, image).fireflies == 0);
  image.at(10, 10) = grey(5.1f);
  image.at(0, 19) = grey(7);
  image.at(15, 5) = grey(4.9f);  // less than ten times
  CHECK(compareImages(reference, image).fireflies == 2);
  // A bright area is an error, but none of single pixels.
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 20; ++x) image.at(x, y) = grey(6);
  CHECK(compareImages(reference, image).fireflies == 2);
}

TEST_CASE("render: images are read back from files") {
  const Folder folder;
  const Image image = gradient(13, 7);
  SECTION("exr keeps the floats") {
    writeImage(folder / "a.exr", image, {{"seed", 4.0}, {"integrator", "path"}});
    const Image back = readImage(folder / "a.exr");
    REQUIRE(back.width == 13);
    REQUIRE(back.height == 7);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) CHECK((back.pixels[i] == image.pixels[i]).all());
    const std::string bytes = bytesOf(folder / "a.exr");
    CHECK(bytes.find("integrator") != std::string::npos);
    writeImage(folder / "b.exr", image, {{"seed", 4.0}, {"integrator", "path"}});
    CHECK(bytes == bytesOf(folder / "b.exr"));
  }
  SECTION("png is sRGB") {
    writeImage(folder / "a.PNG", image);
    const Image back = readImage(folder / "a.PNG");
    REQUIRE(back.width == 13);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      CHECK((back.pixels[i] - image.pixels[i].min(1.0f)).abs().maxCoeff() < 0.01f);
  }
  SECTION("other extensions are rejected") {
    CHECK_THROWS_WITH(writeImage(folder / "a.jpg", image), Catch::Contains("a.jpg") && Catch::Contains(".exr or .png"));
    CHECK_THROWS_WITH(writeImage(folder / "missing" / "a.exr", image), Catch::Contains("a.exr"));
  }
  CHECK(folder.files() <= 2);  // no temporary files remain
}

TEST_CASE("render: error colours increase monotonically with the error") {
  CHECK(errorColour(0).isZero());
  CHECK((errorColour(1e9f) - Rgb::Ones()).abs().maxCoeff() < 1e-6f);
  CHECK(errorColour(kNan).z() == 1);
  float previous = -1;
  for (int i = 0; i <= 20; ++i) {
    const float e = kMapLow * std::pow(kMapHigh / kMapLow, static_cast<float>(i) / 20);
    CHECK(errorColour(e).x() >= previous);
    previous = errorColour(e).x();
  }
  const Folder folder;
  writeErrorMap(folder / "map.png", 4, relativeErrors(Image(4, 3, grey(1)), Image(4, 3, grey(2))));
  const Image map = readImage(folder / "map.png");
  CHECK((map.width == 4 && map.height == 3));
}

TEST_CASE("render: exr files have the type and the compression that are asked for") {
  using Type = ExrFormat::Type;
  using Compression = ExrFormat::Compression;
  const Folder folder;
  const std::filesystem::path path = folder / "a.exr";
  const Image image = gradient(40, 30);
  const std::vector<ImageLayer> layers{{"albedo", "RGB", image}, {"depth", "Z", image, true}};
  const std::array codes{Imf::NO_COMPRESSION,  Imf::RLE_COMPRESSION,  Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
                         Imf::PIZ_COMPRESSION, Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION};
  for (int code = 0; code < 7; ++code)
    for (const Type type : {Type::floats, Type::halves}) {
      const ExrFormat format{type, static_cast<Compression>(code)};
      CAPTURE(code, type == Type::halves);
      CHECK(writeImage(path, image, {}, layers, format) == 0);
      const Imf::InputFile file(path.c_str());
      CHECK(file.header().compression() == codes[code]);
      const Imf::PixelType colours = type == Type::halves ? Imf::HALF : Imf::FLOAT;
      CHECK(file.header().channels()["R"].type == colours);
      CHECK(file.header().channels()["albedo.G"].type == colours);
      CHECK(file.header().channels()["depth.Z"].type == Imf::FLOAT);
      const bool lossy = format.compression >= Compression::dwaa;
      const float tolerance = lossy ? 0.05f : type == Type::halves ? 1e-3f : 0;
      const Image back = readImage(path), depth = *readChannels(path, {"depth.Z", "depth.Z", "depth.Z"});
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        CHECK(((back.pixels[i] - image.pixels[i]).abs() <= tolerance * image.pixels[i].max(1.0f)).all());
        if (!lossy) CHECK(depth.pixels[i].x() == image.pixels[i].x());
      }
    }
}

TEST_CASE("render: values that are too large for halves are clamped and counted") {
  const Folder folder;
  const std::filesystem::path path = folder / "a.exr";
  const Image image(2, 1, Rgb(65504.0f, 65520.0f, 1e30f));
  CHECK(writeImage(path, image, {}, {}, {ExrFormat::Type::halves}) == 4);
  CHECK((readImage(path).at(1, 0) == kLargestHalf).all());
  CHECK(writeImage(path, image) == 0);
  CHECK(readImage(path).at(1, 0).z() == 1e30f);
}

TEST_CASE("render: DWA compression keeps the brightest colours finite, and what is clamped is counted") {
  using Compression = ExrFormat::Compression;
  const Folder folder;
  const std::filesystem::path path = folder / "a.exr";
  constexpr float kBright = 1e6f;
  Image single(16, 16), random(64, 64);
  single.at(3, 4) = grey(kBright);
  Rng rng(1);
  std::size_t bright = 0;
  for (Rgb& pixel : random.pixels)
    for (float& value : pixel)
      if (rng.uniformDouble() < 0.5) value = kBright, ++bright;
  for (const Compression compression : {Compression::dwaa, Compression::dwab})
    for (const auto type : {ExrFormat::Type::floats, ExrFormat::Type::halves})
      for (const auto& [image, clamped] : {std::pair(single, std::size_t{3}), std::pair(random, bright)}) {
        CAPTURE(compression == Compression::dwaa, type == ExrFormat::Type::floats, clamped);
        const std::vector<ImageLayer> layers{{"albedo", "RGB", image},
                                             {"depth", "Z", Image(image.width, image.height, grey(1e6f)), true}};
        CHECK(writeImage(path, image, {}, layers, {type, compression}) == 2 * clamped);
        const Image back = readImage(path), depth = *readChannels(path, {"depth.Z", "depth.Z", "depth.Z"});
        float largest = 0;
        for (std::size_t i = 0; i < back.pixels.size(); ++i) {
          CHECK(back.pixels[i].allFinite());
          CHECK(back.pixels[i].minCoeff() > -0.01f);
          largest = std::max(largest, back.pixels[i].maxCoeff());
          CHECK(depth.pixels[i].x() == 1e6f);
        }
        CHECK(largest == Approx(kLargestDwa).epsilon(0.1));
      }
}

TEST_CASE("render: channels of exr files are read by name, if there are all of them") {
  const Folder folder;
  const Image image = gradient(5, 4);
  writeImage(folder / "a.exr", image, {}, std::vector<ImageLayer>{{"normal", "XYZ", image}});
  const auto normal = readChannels(folder / "a.exr", {"normal.X", "normal.Y", "normal.Z"});
  REQUIRE(normal);
  CHECK((normal->at(4, 3) == image.at(4, 3)).all());
  CHECK(!readChannels(folder / "a.exr", {"normal.X", "normal.Y", "normal.W"}));
  writeImage(folder / "a.png", image);
  CHECK(!readChannels(folder / "a.png", {"R", "G", "B"}));
  CHECK_THROWS_WITH(readChannels(folder / "none.exr", {"R", "G", "B"}), Catch::Contains("none.exr: no such file"));
}
