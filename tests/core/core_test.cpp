#include <cmath>
#include <filesystem>

#include <catch2/catch.hpp>

#include "runtime/core/colour.h"
#include "runtime/core/files.h"
#include "runtime/core/numbers.h"
#include "runtime/core/printable.h"
#include "runtime/core/statistics.h"

namespace lobe {
namespace {

TEST_CASE("core: numbers with trailing characters are rejected") {
  CHECK(parseReal("+1.5e3") == 1500.0);
  CHECK(parseReal("-.25") == -0.25);
  CHECK(!parseReal(""));
  CHECK(!parseReal("1x"));
  CHECK(!parseReal(" 1"));
  CHECK(parseNumber(" 1\r\n") == 1.0);
  CHECK(!parseNumber("inf"));
  CHECK(parseInteger("7") == 7);
  CHECK(!parseInteger("7.5"));
  CHECK(parseNumbers("1, 2 3") == std::vector<double>{1, 2, 3});
  CHECK(!parseNumbers("1,"));
}

TEST_CASE("core: numbers out of range become zero or infinite") {
  CHECK(parseReal("1e-400") == 0.0);
  CHECK(parseReal("1e400") == INFINITY);
  CHECK(parseReal("-1E400") == -INFINITY);
  CHECK(!parseNumber("1e400"));
}

TEST_CASE("core: control characters and bytes that are not UTF-8 are not printed") {
  const std::string sound = "ggx α 0.1×0.3 ~ \xc2\xa0\xf0\x9f\x98\x80";
  CHECK(printable(sound) == sound);
  CHECK(printable("") == "");
  CHECK(printable("a\x1b[2J\r\nb\t\x7f") == "a?[2J??b??");
  CHECK(printable(std::string_view("a\0b", 3)) == "a?b");
  CHECK(printable("\xc2\x9b"
                  "1m|\x9b|\xc1\x9b|\xff|\xce") == "?1m|?|?|?|?");
  CHECK(printable("\xe2\x82"
                  "x\xf8\x80") == "??x??");
}

TEST_CASE("core: the sRGB transfer function and its inverse agree") {
  for (int i = 0; i <= 64; ++i) {
    const float x = static_cast<float>(i) / 64;
    CHECK(decodeSrgb(encodeSrgb(x)) == Approx(x).margin(1e-5));
  }
  CHECK(encodeSrgb(0.5f) == Approx(0.735357).epsilon(1e-5));  // IEC 61966-2-1
  CHECK(encodeSrgb(-1) == 0);
  CHECK(encodeSrgb(NAN) == 0);
  CHECK(encodeSrgb(2) == Approx(1));
}

TEST_CASE("core: quantiles interpolate between the nearest values") {
  CHECK(median({3, 1, 2}) == 2);
  CHECK(median({4, 1, 3, 2}) == 2.5);
  CHECK(quantile({0, 10}, 0.9) == Approx(9));
  CHECK(quantile({5}, 1) == 5);
  CHECK(std::isnan(median({})));
}

TEST_CASE("statistics: a trimmed mean leaves out the largest values") {
  CHECK(trimmedMean({100, 1, 3, 2}, 0.25) == Approx(2));
  CHECK(trimmedMean({100, 1, 3, 2}, 0.24) == Approx(26.5));
  CHECK(trimmedMean({5}, 0.9) == Approx(5));
  CHECK(std::isnan(trimmedMean({}, 0.1)));
}

TEST_CASE("core: errors name what is not a regular file") {
  const auto message = [](const std::filesystem::path& path) -> std::string {
    try {
      nameErrors(path, [&] { return readFile(path); });
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return {};
  };
  CHECK(message("/no/such/file") == "/no/such/file: no such file");
  CHECK(message("/") == "/: is a folder, not a file");
  CHECK(message("/dev/null") == "/dev/null: is not a regular file");
}

TEST_CASE("core: too little memory for a file is named, but is not a fault of the file") {
  const auto read = [] { return nameErrors("a.png", []() -> int { throw std::bad_alloc(); }); };
  CHECK_THROWS_AS(read(), OutOfMemory);
  CHECK_THROWS_WITH(read(), "a.png: not enough memory");
}

}  // namespace
}  // namespace lobe
