#include "runtime/image/image.h"

#include <ImfChannelList.h>
#include <ImfChromaticities.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfTestFile.h>
#include <ImfVersion.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <variant>

#include <fmt/format.h>
#include <Eigen/LU>

#include "runtime/core/colour.h"
#include "runtime/core/files.h"
#include "runtime/core/fingerprint.h"
#include "runtime/image/exr_file.h"
#include "runtime/image/image_limits.h"
#include "runtime/image/jpeg_file.h"
#include "runtime/image/png_file.h"
#include "runtime/image/rgbe_file.h"

// Static functions, so that another copy of stb_image in the program does not clash.
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_NO_GIF
#define STBI_NO_HDR
#define STBI_NO_JPEG
#define STBI_NO_LINEAR
#define STBI_NO_PIC
#define STBI_NO_PNG
#define STBI_NO_PNM
#define STBI_NO_PSD
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

namespace lobe {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& fault) {
  throw std::runtime_error(fmt::format("{}: {}", path.string(), fault));
}

float decode(float encoded, const Encoding& encoding) {
  switch (encoding.kind) {
    case Encoding::Kind::linear:
      return encoded;
    case Encoding::Kind::gamma:
      return std::pow(encoded, encoding.exponent);
    case Encoding::Kind::srgb:
    case Encoding::Kind::tagged:  // no gAMA chunk
      break;
  }
  return decodeSrgb(encoded);
}

// ---- EXR

/// The part of a file that is read: its colours, or its alpha channel as grey.
enum class Part { colours, alpha };

using ChannelNames = std::array<std::string, 3>;

[[noreturn]] void failWithoutAlpha(const std::filesystem::path& path) {
  fail(path, "it has no alpha channel");
}

/// The names of the channels to read as red, green and blue.
ChannelNames exrChannels(const std::filesystem::path& path, const Imf::ChannelList& channels, Part part) {
  if (part == Part::alpha && channels.findChannel("A")) return {"A", "A", "A"};
  if (part == Part::alpha) failWithoutAlpha(path);
  if (channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B")) return {"R", "G", "B"};
  const bool chroma = channels.findChannel("RY") || channels.findChannel("BY");
  if (channels.findChannel("Y") && !chroma) return {"Y", "Y", "Y"};
  std::string names;
  for (auto it = channels.begin(); it != channels.end(); ++it) names += fmt::format(" {}", it.name());
  fail(path, fmt::format("needs the channels R, G and B, or only Y, but has{}", names.empty() ? " none" : names));
}

struct Area {
  explicit Area(const Imath::Box2i& window)
      : left(window.min.x),
        top(window.min.y),
        width(std::int64_t{window.max.x} - window.min.x + 1),
        height(std::int64_t{window.max.y} - window.min.y + 1) {}
  std::int64_t right() const { return left + width; }
  std::int64_t bottom() const { return top + height; }
  std::int64_t left, top, width, height;
};

/// Makes OpenEXR read the requested channels of any line of the data window into this one.
void readInto(std::vector<Rgb>& line, const std::filesystem::path& path, Imf::InputFile& file, const Area& data,
              const ChannelNames& names) {
  // OpenEXR addresses pixels by their coordinates in the data window, hence the shifted origin.
  constexpr std::int64_t kStride = sizeof(Rgb);
  char* origin = reinterpret_cast<char*>(line.data()) - kStride * data.left;
  Imf::FrameBuffer frame;
  for (std::size_t c = 0; c < names.size() && (c == 0 || names[c] != names[0]); ++c) {
    const Imf::Channel& channel = file.header().channels()[names[c]];
    if (channel.xSampling != 1 || channel.ySampling != 1) fail(path, "subsampled channels are not supported");
    frame.insert(names[c], Imf::Slice(Imf::FLOAT, origin + c * sizeof(float), kStride, 0));
  }
  file.setFrameBuffer(frame);
}

/// Reads the requested channels of the display window line by line; pixels outside the data window are black.
Image readDisplayWindow(const std::filesystem::path& path, Imf::InputFile& file, const ChannelNames& names) {
  const Area data(file.header().dataWindow()), display(file.header().displayWindow());
  Image image(static_cast<int>(display.width), static_cast<int>(display.height));
  std::vector<Rgb> line(static_cast<std::size_t>(data.width));
  readInto(line, path, file, data, names);
  const std::int64_t left = std::max(data.left, display.left), right = std::min(data.right(), display.right());
  if (left >= right) return image;
  for (std::int64_t y = std::max(data.top, display.top); y < std::min(data.bottom(), display.bottom()); ++y) {
    file.readPixels(static_cast<int>(y));
    if (names[1] == names[0])
      for (Rgb& pixel : line) pixel = Rgb::Constant(pixel.x());
    std::copy_n(&line[left - data.left], right - left,
                &image.pixels[(y - display.top) * display.width + left - display.left]);
  }
  return image;
}

/// From linear RGB with these primaries to CIE XYZ; their white has a luminance of 1.
Eigen::Matrix3d xyzOfRgb(const Imf::Chromaticities& chromaticities) {
  const auto xyz = [](const Imath::V2f& p) { return Eigen::Vector3d(p.x, p.y, 1.0 - p.x - p.y); };
  Eigen::Matrix3d primaries;
  primaries << xyz(chromaticities.red), xyz(chromaticities.green), xyz(chromaticities.blue);
  const Eigen::Vector3d white = xyz(chromaticities.white) / chromaticities.white.y;
  return primaries * Eigen::Vector3d(primaries.inverse() * white).asDiagonal();
}

/// With Mitsuba's tolerance.
bool isEqual(const Imf::Chromaticities& a, const Imf::Chromaticities& b) {
  return (a.red - b.red).length2() + (a.green - b.green).length2() + (a.blue - b.blue).length2() +
             (a.white - b.white).length2() <
         1e-6f;
}

/// Converts colours to Rec. 709 if the file says that they have other primaries, without adaptation of the white, as
/// in Mitsuba. Negative components of colours that had none, which are outside the gamut, become zero.
void convertToRec709(const std::filesystem::path& path, const Imf::Header& header, Image& image) {
  if (!Imf::hasChromaticities(header)) return;
  const Imf::Chromaticities rec709, given = Imf::chromaticities(header);
  if (isEqual(given, rec709)) return;
  const Eigen::Matrix3f matrix = (xyzOfRgb(rec709).inverse() * xyzOfRgb(given)).cast<float>();
  // Far above those of all colour spaces, but exceeded if the primaries are on a line.
  constexpr float kLargest = 1e4f;
  if (!(matrix.array().abs() <= kLargest).all()) fail(path, "its chromaticities are not those of a colour space");
  for (Rgb& pixel : image.pixels) {
    const bool clamps = pixel.allFinite() && (pixel >= 0.0f).all();
    pixel = (matrix * pixel.matrix()).array().eval();
    if (clamps) pixel = pixel.max(0.0f).eval();
  }
}

/// How the channels of a file are used: data are not converted.
enum class Use { colours, data };

/// namesOf: given the list of channels, which to read; nullopt: none, and there is no image.
template <class NamesOf>
std::optional<Image> readExrPixels(const std::filesystem::path& path, Use use, const NamesOf& namesOf) {
  const std::unique_ptr<Imf::InputFile> opened = openExr(path);
  Imf::InputFile& file = *opened;
  const std::optional<ChannelNames> names = namesOf(file.header().channels());
  if (!names) return std::nullopt;
  Image image = readDisplayWindow(path, file, *names);
  const bool isGrey = (*names)[1] == (*names)[0];
  if (use == Use::colours && !isGrey) convertToRec709(path, file.header(), image);
  return image;
}

template <class NamesOf>
std::optional<Image> readExr(const std::filesystem::path& path, Use use, const NamesOf& namesOf) {
  return nameExrErrors(path, [&] { return readExrPixels(path, use, namesOf); });
}

// ---- Other formats

struct FreePixels {
  void operator()(void* pixels) const { stbi_image_free(pixels); }
};
using Pixels = std::unique_ptr<stbi_uc, FreePixels>;

/// Callbacks through which stb_image reads the file. They detect reads past its end, because stb_image accepts
/// truncated TGA files.
struct Source {
  std::string_view rest;
  bool exhausted = false;

  static int read(void* user, char* out, int size) {
    Source& source = *static_cast<Source*>(user);
    const std::size_t n = std::min(source.rest.size(), static_cast<std::size_t>(size));
    std::copy_n(source.rest.data(), n, out);
    source.rest.remove_prefix(n);
    if (n == 0) source.exhausted = true;
    return static_cast<int>(n);
  }
  static void skip(void* user, int size) {
    Source& source = *static_cast<Source*>(user);
    const auto n = static_cast<std::size_t>(std::max(0, size));
    if (n > source.rest.size()) source.exhausted = true;
    source.rest.remove_prefix(std::min(n, source.rest.size()));
  }
  static int eof(void* user) { return static_cast<Source*>(user)->rest.empty(); }
};
constexpr stbi_io_callbacks kSourceCallbacks = {Source::read, Source::skip, Source::eof};

/// Red, green, blue and alpha of a pixel.
constexpr int kComponents = 4;

/// Decodes the pixels of an integer format with a look-up table of all values.
template <class T>
Image decodeColours(const T* codes, int width, int height, const Encoding& encoding) {
  constexpr int kLargest = std::numeric_limits<T>::max();
  std::vector<float> linear(kLargest + 1);
  for (int i = 0; i <= kLargest; ++i) linear[i] = decode(static_cast<float>(i) / kLargest, encoding);
  Image image(width, height);
  for (Rgb& pixel : image.pixels) {
    pixel = Rgb(linear[codes[0]], linear[codes[1]], linear[codes[2]]);
    codes += kComponents;
  }
  return image;
}

template <class T>
Image decodeAlpha(const T* codes, int width, int height) {
  Image image(width, height);
  for (Rgb& pixel : image.pixels) {
    pixel = grey(static_cast<float>(codes[3]) / std::numeric_limits<T>::max());
    codes += kComponents;
  }
  return image;
}

/// The requested part of an image in an integer format.
template <class T>
Image decodePart(const T* codes, int width, int height, const Encoding& encoding, Part part) {
  return part == Part::alpha ? decodeAlpha(codes, width, height) : decodeColours(codes, width, height, encoding);
}

/// Loads an image with stb_image.
Image loadPixels(const std::filesystem::path& path, std::string_view bytes, const Encoding& encoding, Part part) {
  Source source{bytes};
  int width = 0, height = 0, channels = 0;
  const Pixels pixels(stbi_load_from_callbacks(&kSourceCallbacks, &source, &width, &height, &channels, kComponents));
  if (source.exhausted) fail(path, "damaged image (it ends too early)");
  if (!pixels) fail(path, fmt::format("damaged image ({})", stbi_failure_reason()));
  return decodePart(pixels.get(), width, height, encoding, part);
}

Image readHdr(const std::filesystem::path& path, std::string_view bytes, Part part) {
  if (part == Part::alpha) failWithoutAlpha(path);
  const auto [width, height] = nameErrors(path, [&] { return sizeOfRgbe(bytes); });
  checkImageSize(path, width, height, bytes.size());
  return nameErrors(path, [&] { return readRgbe(bytes); });
}

/// Replaces a tagged encoding by the one that a PNG specifies.
Encoding resolved(const Encoding& encoding, std::string_view bytes) {
  if (encoding.kind != Encoding::Kind::tagged) return encoding;
  const std::optional<float> gamma = gammaOfPng(bytes);
  return gamma ? Encoding{Encoding::Kind::gamma, *gamma} : encoding;
}

Image readPngImage(const std::filesystem::path& path, std::string_view bytes, const Encoding& encoding, Part part) {
  const PngHeader header = nameErrors(path, [&] { return headerOfPng(bytes); });
  // A byte of deflated data stands for at most 1032 bytes.
  checkImageSize(path, header.width, header.height, bytes.size(),
                 8 * 1032u / static_cast<unsigned>(header.bitsPerPixel));
  if (part == Part::alpha && !header.hasAlpha) failWithoutAlpha(path);
  const PngCodes pixels = nameErrors(path, [&] { return readPng(bytes); });
  const auto decodeCodes = [&](const auto& codes) {
    return decodePart(codes.data(), header.width, header.height, resolved(encoding, bytes), part);
  };
  return std::visit(decodeCodes, pixels);
}

Image readJpegImage(const std::filesystem::path& path, std::string_view bytes, const Encoding& encoding, Part part) {
  if (part == Part::alpha) failWithoutAlpha(path);
  const JpegSize size = nameErrors(path, [&] { return sizeOfJpeg(bytes); });
  checkImageSize(path, size.width, size.height, bytes.size());
  const JpegPixels pixels = nameErrors(path, [&] { return readJpeg(bytes); });
  return decodeColours(pixels.codes.data(), pixels.width, pixels.height, encoding);
}

Image readOther(const std::filesystem::path& path, const Encoding& encoding, Part part) {
  const std::string bytes = nameErrors(path, [&] { return readFile(path); });
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    fail(path, "files over 2 GiB are not supported");
  if (startsLikeRgbe(bytes)) return readHdr(path, bytes, part);
  if (startsLikePng(bytes)) return readPngImage(path, bytes, encoding, part);
  if (startsLikeJpeg(bytes)) return readJpegImage(path, bytes, encoding, part);
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  const int length = static_cast<int>(bytes.size());
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(data, length, &width, &height, &channels))
    fail(path, fmt::format("unsupported image format ({}); supported are PNG, JPEG, BMP, TGA, HDR and EXR",
                           stbi_failure_reason()));
  // The height of a BMP is negative if its rows are stored from the top.
  checkImageSize(path, width, std::abs(std::int64_t{height}), bytes.size());
  if (part == Part::alpha && channels != 2 && channels != 4) failWithoutAlpha(path);
  return loadPixels(path, bytes, encoding, part);
}

Image readPart(const std::filesystem::path& path, const Encoding& encoding, Part part) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) fail(path, "no such file");
  if (status.type() == std::filesystem::file_type::none) fail(path, error.message());
  if (!is_regular_file(status)) fail(path, "not a file");
  if (!isExrFile(path)) return readOther(path, encoding, part);
  return *readExr(path, Use::colours,
                  [&](const Imf::ChannelList& channels) { return std::optional(exrChannels(path, channels, part)); });
}

}  // namespace

void addTo(Fingerprint& hash, const Image& image) {
  hash.number(image.width);
  hash.array(std::span<const Rgb>(image.pixels));
}

bool isExrFile(const std::filesystem::path& path) {
  return nameErrors(path, [&] {
    std::ifstream file = openFile(path);
    char magic[4] = {};
    const bool complete = static_cast<bool>(file.read(magic, sizeof(magic)));
    if (file.bad()) throw std::runtime_error("cannot read");
    return complete && Imf::isImfMagic(magic);
  });
}

Image readImage(const std::filesystem::path& path, Encoding encoding) {
  return readPart(path, encoding, Part::colours);
}

Image readAlpha(const std::filesystem::path& path) {
  return readPart(path, {}, Part::alpha);
}

std::optional<Image> readChannels(const std::filesystem::path& path, const std::array<std::string, 3>& names) {
  if (!isExrFile(path)) return std::nullopt;
  return readExr(path, Use::data, [&](const Imf::ChannelList& channels) {
    const bool complete =
        std::ranges::all_of(names, [&](const std::string& name) { return channels.findChannel(name); });
    return complete ? std::optional(names) : std::nullopt;
  });
}

}  // namespace lobe
