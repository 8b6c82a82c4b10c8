#include "materials/image.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfTestFile.h>
#include <ImfVersion.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "materials/fingerprint.h"

// Private to this file, so that another copy elsewhere does not clash.
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_NO_GIF
#define STBI_NO_PIC
#define STBI_NO_PNM
#define STBI_NO_PSD
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

namespace lobe {
namespace {

/// A damaged header must not make us ask for all memory there is.
constexpr std::int64_t kMaxPixels = std::int64_t{1} << 27;

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& fault) {
  throw std::runtime_error(fmt::format("{}: {}", path.string(), fault));
}

void checkSize(const std::filesystem::path& path, std::int64_t width, std::int64_t height) {
  if (width <= 0 || height <= 0 || width > kMaxPixels / height)
    fail(path, fmt::format("its size of {}x{} pixels is beyond what is read", width, height));
}

float decode(float encoded, const Encoding& encoding) {
  switch (encoding.kind) {
    case Encoding::Kind::linear:
      return encoded;
    case Encoding::Kind::gamma:
      return std::pow(encoded, encoding.exponent);
    case Encoding::Kind::srgb:
      break;
  }
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

// ---- EXR

using ChannelNames = std::array<const char*, 3>;

/// The names of the channels to read as red, green and blue.
ChannelNames exrChannels(const std::filesystem::path& path, const Imf::ChannelList& channels) {
  if (channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B")) return {"R", "G", "B"};
  const bool chroma = channels.findChannel("RY") || channels.findChannel("BY");
  if (channels.findChannel("Y") && !chroma) return {"Y", "Y", "Y"};
  std::string names;
  for (auto it = channels.begin(); it != channels.end(); ++it) names += fmt::format(" {}", it.name());
  fail(path, fmt::format("needs channels R, G and B or Y alone, but has{}", names.empty() ? " none" : names));
}

struct Area {
  explicit Area(const Imath::Box2i& window)
      : left(window.min.x),
        top(window.min.y),
        width(std::int64_t{window.max.x} - window.min.x + 1),
        height(std::int64_t{window.max.y} - window.min.y + 1) {}
  bool operator==(const Area&) const = default;
  std::int64_t left, top, width, height;
};

/// What of the data window lies in the display window, black around it.
Image placeOnDisplay(const Image& data, const Area& dataWindow, const Area& display) {
  Image image(static_cast<int>(display.width), static_cast<int>(display.height));
  const std::int64_t dx = display.left - dataWindow.left, dy = display.top - dataWindow.top;
  const std::int64_t first = std::max<std::int64_t>(0, -dx), last = std::min(display.width, dataWindow.width - dx);
  if (first >= last) return image;
  for (std::int64_t y = std::max<std::int64_t>(0, -dy); y < std::min(display.height, dataWindow.height - dy); ++y)
    std::copy_n(&data.pixels[(y + dy) * data.width + first + dx], last - first, &image.pixels[y * image.width + first]);
  return image;
}

/// The data window of the file, whichever of its channels are asked for.
Image readDataWindow(const std::filesystem::path& path, Imf::InputFile& file, const Area& area) {
  const ChannelNames names = exrChannels(path, file.header().channels());
  const int distinct = names[0] == names[1] ? 1 : 3;
  Image image(static_cast<int>(area.width), static_cast<int>(area.height));
  // OpenEXR addresses pixels by their place in the data window, hence the shifted origin.
  constexpr std::int64_t kStride = sizeof(Rgb);
  char* origin = reinterpret_cast<char*>(image.pixels.data()) - kStride * (area.left + area.top * area.width);
  Imf::FrameBuffer frame;
  for (int c = 0; c < distinct; ++c) {
    const Imf::Channel& channel = file.header().channels()[names[c]];
    if (channel.xSampling != 1 || channel.ySampling != 1) fail(path, "subsampled channels are not read");
    frame.insert(names[c], Imf::Slice(Imf::FLOAT, origin + c * sizeof(float), kStride, kStride * area.width));
  }
  file.setFrameBuffer(frame);
  const Imath::Box2i window = file.header().dataWindow();
  file.readPixels(window.min.y, window.max.y);
  if (distinct == 1)
    for (Rgb& pixel : image.pixels) pixel = Rgb::Constant(pixel.x());
  return image;
}

Image readExrPixels(const std::filesystem::path& path) {
  Imf::InputFile file(path.c_str());
  const Area data(file.header().dataWindow()), display(file.header().displayWindow());
  checkSize(path, data.width, data.height);
  checkSize(path, display.width, display.height);
  Image image = readDataWindow(path, file, data);
  return data == display ? image : placeOnDisplay(image, data, display);
}

Image readExr(const std::filesystem::path& path) {
  try {
    return readExrPixels(path);
  } catch (const std::bad_alloc&) {
    fail(path, "too large for the memory there is");
  } catch (const Iex::BaseExc& e) {
    fail(path, fmt::format("damaged EXR file ({})", e.what()));
  }
}

// ---- everything else

struct FreePixels {
  void operator()(void* pixels) const { stbi_image_free(pixels); }
};
template <class T>
using Pixels = std::unique_ptr<T, FreePixels>;

/// The file as stb_image takes it, to find out whether it asks for more than there is: JPEG and TGA files cut short
/// would pass for whole ones, and an HDR file would be read for ever, zeros being all that follows its end. So some
/// ones follow.
struct Source {
  std::string_view rest;
  std::int64_t padding;
  bool exhausted = false;

  static int read(void* user, char* out, int size) {
    Source& source = *static_cast<Source*>(user);
    const std::size_t n = std::min(source.rest.size(), static_cast<std::size_t>(size));
    std::copy_n(source.rest.data(), n, out);
    source.rest.remove_prefix(n);
    if (n > 0) return static_cast<int>(n);
    source.exhausted = true;
    const auto ones = static_cast<int>(std::min<std::int64_t>(source.padding, size));
    source.padding -= ones;
    std::fill_n(out, ones, '\1');
    return ones;
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

/// The pixels of an integer format by a table of what each code means.
template <class T>
Image decodeCodes(const T* codes, int width, int height, const Encoding& encoding) {
  constexpr int kLargest = std::numeric_limits<T>::max();
  std::vector<float> linear(kLargest + 1);
  for (int i = 0; i <= kLargest; ++i) linear[i] = decode(static_cast<float>(i) / kLargest, encoding);
  Image image(width, height);
  for (Rgb& pixel : image.pixels) {
    pixel = Rgb(linear[codes[0]], linear[codes[1]], linear[codes[2]]);
    codes += 3;
  }
  return image;
}

struct Size {
  int width = 0, height = 0;
};

/// Loads by one of stb_image's functions, three channels a pixel.
template <class T, class Load>
Pixels<T> loadPixels(const std::filesystem::path& path, std::string_view bytes, std::int64_t padding, Load load,
                     Size& size) {
  Source source{bytes, padding};
  int channels = 0;
  Pixels<T> pixels(load(&kSourceCallbacks, &source, &size.width, &size.height, &channels, 3));
  if (source.exhausted) fail(path, "damaged image (it ends too early)");
  if (!pixels) fail(path, fmt::format("damaged image ({})", stbi_failure_reason()));
  return pixels;
}

Image readHdr(const std::filesystem::path& path, std::string_view bytes, Size size) {
  // A run-length coded pixel takes at most eight bytes, and the line it is in four more.
  const std::int64_t padding = std::int64_t{16} * size.width * size.height;
  const Pixels<float> pixels = loadPixels<float>(path, bytes, padding, stbi_loadf_from_callbacks, size);
  Image image(size.width, size.height);
  std::copy_n(pixels.get(), image.pixels.size() * 3, image.pixels.data()->data());
  return image;
}

std::string readBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(std::filesystem::file_size(path), '\0');
  if (!file || !file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) fail(path, "cannot read");
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) fail(path, "too large a file");
  return bytes;
}

Image readOther(const std::filesystem::path& path, const Encoding& encoding) {
  const std::string bytes = readBytes(path);
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  const int length = static_cast<int>(bytes.size());
  Size size;
  int channels = 0;
  if (!stbi_info_from_memory(data, length, &size.width, &size.height, &channels))
    fail(path, fmt::format("not an image that can be read ({}); known are PNG, JPEG, BMP, TGA, HDR and EXR",
                           stbi_failure_reason()));
  checkSize(path, size.width, size.height);
  if (stbi_is_hdr_from_memory(data, length)) return readHdr(path, bytes, size);
  if (stbi_is_16_bit_from_memory(data, length)) {
    const Pixels<stbi_us> pixels = loadPixels<stbi_us>(path, bytes, 0, stbi_load_16_from_callbacks, size);
    return decodeCodes(pixels.get(), size.width, size.height, encoding);
  }
  const Pixels<stbi_uc> pixels = loadPixels<stbi_uc>(path, bytes, 0, stbi_load_from_callbacks, size);
  return decodeCodes(pixels.get(), size.width, size.height, encoding);
}

bool startsLikeExr(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  char magic[4] = {};
  return file.read(magic, 4) && Imf::isImfMagic(magic);
}

}  // namespace

void addTo(Fingerprint& hash, const Image& image) {
  hash.number(image.width);
  hash.array(std::span<const Rgb>(image.pixels));
}

Image readImage(const std::filesystem::path& path, Encoding encoding) {
  if (!std::filesystem::exists(path)) fail(path, "no such file");
  if (!std::filesystem::is_regular_file(path)) fail(path, "not a file");
  return startsLikeExr(path) ? readExr(path) : readOther(path, encoding);
}

}  // namespace lobe
