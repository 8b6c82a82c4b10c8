// Images that cannot be used as elements ask for: each is examined once, however many elements ask.

#include <cstdint>
#include <string>

#include <catch2/catch.hpp>

#include "scenes/mitsuba/reader_images.h"
#include "tests/support/scenes_test_tools.h"
#include "tests/support/small_images.h"

namespace lobe {
namespace {

constexpr std::uint32_t kSide = 4096;

/// A black PNG whose last pixel is blue.
std::string bluePng() {
  std::string rows(kSide * (1 + 3 * kSide), '\0');
  rows.back() = '\xff';
  return pngFile({kSide, kSide, 8, PngColours::rgb}, deflated(rows));
}

std::string bitmap(int gamma) {
  return "<texture type=\"bitmap\"><string name=\"filename\" value=\"a.png\"/><float name=\"gamma\" value=\"" +
         std::to_string(gamma) + "\"/></texture>";
}

/// Of so many requests for a channel of a.png in linear encoding, the number of those that fail with this message. The
/// body of the scene lists the images that are in memory.
int faults(const std::string& body, const std::string& channel, int requests, const std::string& message) {
  const TestFolder folder;
  folder.write("a.png", bluePng());
  Findings findings;
  const SceneFile file(folder.write("a.xml", sceneOf(body)), {}, findings);
  const ReadOptions options;
  Scene scene;
  ReadContext context(file, options, scene, findings);
  ImageStore store(context);
  Parameters parameters;
  parameters.set("filename", std::string("a.png"));
  parameters.set("gamma", 1.0);
  parameters.set("channel", channel);
  const ImageRequest request = bitmapRequest(context, parameters);
  const std::shared_ptr<const Image> image = store.get(context, file.scene(), parameters, request, "");
  int found = 0;
  for (int i = 0; i < requests; ++i) {
    try {
      store.prepared(context, file.scene(), parameters, request, image, Sign::positive);
    } catch (const std::runtime_error& error) {
      if (std::string(error.what()).find(message) != std::string::npos) ++found;
    }
  }
  return found;
}

}  // namespace

// Looking at all pixels for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: many bitmaps with a channel that the image does not have take little time") {
  CHECK(faults(bitmap(1), "q", 100000, "unknown channel \"q\"") == 100000);
  CHECK(faults(bitmap(1), "y", 100000, "only grey images have a channel y") == 100000);
}

// Copying all pixels for each of them would take far longer than the time limit of a test.
TEST_CASE("scenes: many bitmaps with a channel for which there are too many pixels take little time", "[slow]") {
  std::string body;
  for (int gamma = 1; gamma <= 8; ++gamma) body += bitmap(gamma);
  CHECK(faults(body, "r", 20000, "more than 134217728 pixels together") == 20000);
}

}  // namespace lobe
