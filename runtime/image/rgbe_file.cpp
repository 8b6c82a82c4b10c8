#include "runtime/image/rgbe_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "runtime/core/colour.h"

namespace lobe {
namespace {

[[noreturn]] void fail(const std::string& fault) {
  throw std::runtime_error(fault);
}

/// Three mantissas and the exponent that they share.
using Rgbe = std::array<std::uint8_t, 4>;

class Bytes {
 public:
  explicit Bytes(std::string_view rest) : rest_(rest) {}

  std::uint8_t next() {
    if (rest_.empty()) fail("damaged image (unexpected end of file)");
    const auto byte = static_cast<std::uint8_t>(rest_.front());
    rest_.remove_prefix(1);
    return byte;
  }

  Rgbe pixel() {
    Rgbe pixel;
    for (std::uint8_t& byte : pixel) byte = next();
    return pixel;
  }

  /// The text up to the next line feed, without it and without a carriage return before it.
  std::string_view line() {
    const std::size_t length = rest_.find('\n');
    if (length == std::string_view::npos) fail("damaged image (unexpected end of file)");
    std::string_view line = rest_.substr(0, length);
    rest_.remove_prefix(length + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }

 private:
  std::string_view rest_;
};

/// One of the two axes along which pixels are stored: its name, direction and length.
struct Axis {
  char name;
  bool rising;
  int size;
};

/// Pixels of a scanline follow each other along the second axis, scanlines along the first.
struct Header {
  bool xyz = false;
  Axis lines, pixels;
};

/// Parses an axis such as "+X 640" and removes it from the text.
Axis takeAxis(std::string_view& text) {
  constexpr int kLargest = 1 << 27;
  Axis axis{};
  const std::string_view start = text.substr(0, 3);
  const bool known = start == "+X " || start == "-X " || start == "+Y " || start == "-Y ";
  const char* begin = text.data() + std::min<std::size_t>(3, text.size());
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), axis.size);
  if (!known || error != std::errc() || axis.size <= 0 || axis.size > kLargest)
    fail(fmt::format("damaged image (expected a size such as -Y 480 +X 640, found \"{}\")", text.substr(0, 40)));
  axis.name = text[1];
  axis.rising = text[0] == '+';
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  if (text.starts_with(' ')) text.remove_prefix(1);
  return axis;
}

Header readHeader(Bytes& bytes) {
  constexpr std::string_view kFormat = "FORMAT=";
  Header header{};
  bytes.line();  // the signature
  for (std::string_view line = bytes.line(); !line.empty(); line = bytes.line()) {
    if (!line.starts_with(kFormat)) continue;
    line.remove_prefix(kFormat.size());
    header.xyz = line == "32-bit_rle_xyze";
    if (!header.xyz && line != "32-bit_rle_rgbe")
      fail(fmt::format("unknown pixel format \"{}\"; supported are 32-bit_rle_rgbe and 32-bit_rle_xyze", line));
  }
  std::string_view size = bytes.line();
  header.lines = takeAxis(size);
  header.pixels = takeAxis(size);
  if (header.lines.name == header.pixels.name) fail("damaged image (the size names the same axis twice)");
  return header;
}

[[noreturn]] void failAtRun() {
  fail("damaged image (a run of pixels is longer than its scanline)");
}

/// New run-length encoding: all first components of the scanline, then all second ones, and so on.
void readComponents(Bytes& bytes, std::span<Rgbe> line) {
  constexpr std::size_t kRun = 128;
  for (std::size_t component = 0; component < 4; ++component) {
    for (std::size_t i = 0; i < line.size();) {
      const std::size_t code = bytes.next();
      const std::size_t count = code > kRun ? code - kRun : code;
      if (count == 0 || count > line.size() - i) failAtRun();
      const std::uint8_t repeated = code > kRun ? bytes.next() : 0;
      for (const std::size_t end = i + count; i < end; ++i) line[i][component] = code > kRun ? repeated : bytes.next();
    }
  }
}

/// Uncompressed pixels and old run-length encoding: a pixel whose mantissas are all 1 repeats the previous pixel; its
/// exponent is the number of repetitions. Several such pixels in a row hold the bytes of one number, the lowest first.
void readPixels(Bytes& bytes, Rgbe pixel, std::span<Rgbe> line) {
  int shift = 0;
  for (std::size_t i = 0;; pixel = bytes.pixel()) {
    if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
      const std::size_t count = shift < 32 ? std::size_t{pixel[3]} << shift : line.size();
      if (i == 0 || count > line.size() - i) failAtRun();
      std::fill_n(line.begin() + static_cast<std::ptrdiff_t>(i), count, line[i - 1]);
      i += count;
      shift += 8;
    } else {
      line[i++] = pixel;
      shift = 0;
    }
    if (i == line.size()) return;
  }
}

void readLine(Bytes& bytes, std::span<Rgbe> line) {
  constexpr std::size_t kShortest = 8, kLongest = 0x7fff;  // lengths of scanlines with new run-length encoding
  const Rgbe first = bytes.pixel();
  const bool coded = first[0] == 2 && first[1] == 2 && first[2] < 128 && line.size() >= kShortest;
  if (!coded || line.size() > kLongest) return readPixels(bytes, first, line);
  if (static_cast<std::size_t>(first[2] << 8 | first[3]) != line.size())
    fail("damaged image (a scanline of the wrong length)");
  readComponents(bytes, line);
}

Rgb decode(const Rgbe& pixel, bool xyz) {
  if (pixel[3] == 0) return Rgb::Zero();
  const double unit = std::ldexp(1.0, pixel[3] - 136);
  const Eigen::Vector3d value = unit * Eigen::Vector3d(pixel[0], pixel[1], pixel[2]);
  return xyz ? rgbOfXyz(value) : Rgb(value.cast<float>().array());
}

/// Position of the i-th element along the axis, counted from the left or from the top.
int place(const Axis& axis, int i) {
  const bool forwards = axis.name == 'X' ? axis.rising : !axis.rising;
  return forwards ? i : axis.size - 1 - i;
}

}  // namespace

bool startsLikeRgbe(std::string_view bytes) {
  return bytes.starts_with("#?RADIANCE") || bytes.starts_with("#?RGBE");
}

std::array<int, 2> sizeOfRgbe(std::string_view data) {
  Bytes bytes(data);
  const Header header = readHeader(bytes);
  if (header.lines.name == 'Y') return {header.pixels.size, header.lines.size};
  return {header.lines.size, header.pixels.size};
}

Image readRgbe(std::string_view data) {
  Bytes bytes(data);
  const auto [xyz, lines, pixels] = readHeader(bytes);
  // Grows during reading, so that a truncated file does not allocate memory for pixels that it does not contain.
  std::vector<Rgbe> stored;
  const auto length = static_cast<std::size_t>(pixels.size);
  for (int i = 0; i < lines.size; ++i) {
    stored.resize(stored.size() + length);
    readLine(bytes, std::span(stored).last(length));
  }
  const bool rows = lines.name == 'Y';
  Image image(rows ? pixels.size : lines.size, rows ? lines.size : pixels.size);
  for (int i = 0; i < lines.size; ++i)
    for (int j = 0; j < pixels.size; ++j) {
      const int line = place(lines, i), pixel = place(pixels, j);
      image.at(rows ? pixel : line, rows ? line : pixel) =
          decode(stored[i * length + static_cast<std::size_t>(j)], xyz);
    }
  return image;
}

}  // namespace lobe
