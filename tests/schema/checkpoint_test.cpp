// The checkpoint file: round trips and rejection of invalid files.

#include <bit>
#include <functional>
#include <limits>

#include "checkpoint_generated.h"
#include "runtime/core/atomic_file.h"
#include "schema/checkpoint_file.h"
#include "tests/support/schema_test_tools.h"

using namespace lobe;
using namespace lobe::test;

namespace {

struct Content {
  CheckpointInfo info;
  std::vector<StoredPixel> pixels;
  std::vector<std::byte> illumination, importance;
  std::vector<std::byte> encode() const { return encodeCheckpoint(info, pixels, illumination, importance); }
};

Content smallFile() {
  Content c;
  c.info = {
      {{"--seed", "7"}, {"the size", "2x1"}}, 2, 1, 1.5, 2.5, {{0.5, 1000, 20, -1.25}}, 0.25, true, {3, 4, 5}, {}, {}};
  c.info.pilot = {1, 2, 3, 4, 5, 6};
  c.info.lightPathTrial = {1, 2, 3, 4, 5, 6, 7};
  c.pixels = {{{1, 2, 3}, {4, 5, 6}, 7, 1}, {{0, 0, 0}, {0, 0, 0}, 0, 0}};
  c.illumination = {std::byte{1}, std::byte{2}};
  c.importance = {std::byte{3}};
  return c;
}

struct Opener {
  TemporaryFolder folder;
  std::filesystem::path path = folder.path / "run.ckpt";

  /// The error message of opening a file with these bytes; empty if it succeeds.
  std::string fault(const std::vector<std::byte>& bytes) const {
    writeAtomically(path, std::span<const std::byte>(bytes));
    try {
      CheckpointFile::open(path);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return {};
  }
};

}  // namespace

TEST_CASE("schema: a checkpoint reads back as written") {
  const Opener opener;
  const Content c = smallFile();
  REQUIRE(c.encode() == c.encode());
  REQUIRE(opener.fault(c.encode()).empty());
  const CheckpointFile file = CheckpointFile::open(opener.path);
  const CheckpointInfo& info = file.info();
  CHECK(info.settings == c.info.settings);
  CHECK((info.width == 2 && info.height == 1 && info.trainingSeconds == 1.5 && info.renderingSeconds == 2.5));
  CHECK((info.undersampledFraction == 0.25 && info.learntFractions && info.counters == c.info.counters));
  REQUIRE(info.passes.size() == 1);
  CHECK((info.passes[0].seconds == 0.5 && info.passes[0].particles == 1000 && info.passes[0].records == 20 &&
         info.passes[0].logLikelihood == -1.25));
  REQUIRE((info.pilot && info.lightPathTrial));
  CHECK((info.pilot->pathVariance == 1 && info.pilot->pathCost == 2 && info.pilot->productVariance == 3 &&
         info.pilot->productCost == 4 && info.pilot->limit == 5 && info.pilot->seconds == 6));
  const StoredLightPathTrial& trial = *info.lightPathTrial;
  CHECK((trial.variance == 1 && trial.cost == 2 && trial.pathsPerPixel == 3 && trial.secondMoment == 4 &&
         trial.left == 5 && trial.costWithLight == 6 && trial.seconds == 7));
  CHECK(std::ranges::equal(std::as_bytes(file.pixels()), std::as_bytes(std::span(c.pixels))));
  CHECK(std::ranges::equal(file.illumination(), c.illumination));
  CHECK(std::ranges::equal(file.importance(), c.importance));
}

TEST_CASE("schema: the layout of checkpoints matches the FlatBuffers schema") {
  const auto pixel = std::bit_cast<fb::Pixel>(StoredPixel{{1, 2, 3}, {4, 5, 6}, 7, 8});
  CHECK((pixel.sum_r() == 1 && pixel.sum_g() == 2 && pixel.sum_b() == 3));
  CHECK((pixel.square_r() == 4 && pixel.square_g() == 5 && pixel.square_b() == 6));
  CHECK((pixel.count() == 7 && pixel.dropped() == 8));
  const auto pass = std::bit_cast<fb::TrainingPass>(StoredPass{1, 2, 3, 4});
  CHECK((pass.seconds() == 1 && pass.particles() == 2 && pass.records() == 3 && pass.log_likelihood() == 4));
  const auto pilot = std::bit_cast<fb::Pilot>(StoredPilot{1, 2, 3, 4, 5, 6});
  CHECK((pilot.path_variance() == 1 && pilot.path_cost() == 2 && pilot.product_variance() == 3 &&
         pilot.product_cost() == 4 && pilot.limit() == 5 && pilot.seconds() == 6));
  const auto trial = std::bit_cast<fb::LightPathTrial>(StoredLightPathTrial{1, 2, 3, 4, 5, 6, 7});
  CHECK((trial.variance() == 1 && trial.cost() == 2 && trial.paths_per_pixel() == 3 && trial.second_moment() == 4 &&
         trial.left() == 5 && trial.cost_with_light() == 6 && trial.seconds() == 7));
}

TEST_CASE("schema: invalid content of a checkpoint is refused") {
  const Opener opener;
  const auto fault = [&](const std::function<void(Content&)>& change) {
    Content c = smallFile();
    change(c);
    return opener.fault(c.encode());
  };
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK_THAT(fault([](Content& c) { c.info.width = 3; }), Catch::Contains("2 pixels for a film of 3x1"));
  CHECK_THAT(fault([](Content& c) { c.info.width = c.info.height = 0x10000; }), Catch::Contains("2 pixels for a film"));
  CHECK_THAT(fault([](Content& c) { c.pixels.clear(), c.info.width = 0; }), Catch::Contains("0 pixels"));
  CHECK_THAT(fault([](Content& c) { c.pixels[1].sum[2] = -1; }), Catch::Contains("pixel 1: a sum"));
  CHECK_THAT(fault([&](Content& c) { c.pixels[0].squares[0] = infinity; }), Catch::Contains("pixel 0: a sum"));
  CHECK_THAT(fault([](Content& c) { c.pixels[0].dropped = 0xffffffff; }), Catch::Contains("number of samples"));
  CHECK_THAT(fault([&](Content& c) { c.info.renderingSeconds = infinity; }), Catch::Contains("a time"));
  CHECK_THAT(fault([](Content& c) { c.info.passes[0].seconds = -1; }), Catch::Contains("a time"));
  CHECK_THAT(fault([&](Content& c) { c.info.passes[0].seconds = infinity; }), Catch::Contains("a time"));
  CHECK_THAT(fault([](Content& c) { c.info.undersampledFraction = 2; }), Catch::Contains("undersampled"));
  CHECK_THAT(fault([](Content& c) { c.info.pilot->seconds = -1; }), Catch::Contains("time of a choice"));
  CHECK_THAT(fault([&](Content& c) { c.info.lightPathTrial->seconds = infinity; }),
             Catch::Contains("time of a choice"));
  CHECK_THAT(fault([](Content& c) { c.info.lightPathTrial->pathsPerPixel = 0; }), Catch::Contains("light paths"));
}

TEST_CASE("schema: no damaged byte of a checkpoint passes, with or without a valid hash") {
  const Opener opener;
  const std::vector<std::byte> whole = smallFile().encode();
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::vector<std::byte> bytes = whole;
    bytes[i] ^= std::byte{0x41};
    CHECK_FALSE(opener.fault(bytes).empty());
    reseal(bytes);
    opener.fault(bytes);  // must not crash; many changes are valid content
  }
  for (std::size_t size = 0; size < whole.size(); size += 3)
    CHECK_FALSE(opener.fault({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}).empty());
}
