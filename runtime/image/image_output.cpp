#include "runtime/image/image_output.h"

#include <array>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <list>
#include <new>
#include <stdexcept>

#include <ImfChannelList.h>
#include <ImfDoubleAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>
#include <half.h>

#include "runtime/core/atomic_file.h"
#include "runtime/core/colour.h"
#include "runtime/core/files.h"
#include "runtime/image/exr_file.h"

#ifndef __clang_analyzer__  // which reports code of the library
#define STB_IMAGE_WRITE_IMPLEMENTATION
#endif
#define STB_IMAGE_WRITE_STATIC
#include <stb/stb_image_write.h>

namespace lobe {
namespace {

std::vector<std::uint8_t> encodePixels(const Image& image) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * image.pixels.size());
  for (const Rgb& pixel : image.pixels)
    for (const float value : pixel) bytes.push_back(static_cast<std::uint8_t>(std::lround(255.0f * encodeSrgb(value))));
  return bytes;
}

Imf::Compression codeOf(ExrFormat::Compression compression) {
  constexpr std::array codes{Imf::NO_COMPRESSION,  Imf::RLE_COMPRESSION,  Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
                             Imf::PIZ_COMPRESSION, Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION};
  return codes[static_cast<std::size_t>(compression)];
}

Imf::Header makeHeader(const Image& image, const ImageAttributes& attributes, const ExrFormat& format) {
  Imf::Header header(image.width, image.height);
  header.compression() = codeOf(format.compression);
  for (const auto& [name, value] : attributes) {
    if (const auto* text = std::get_if<AttributeText>(&value))
      header.insert(name, Imf::StringAttribute(*text));
    else
      header.insert(name, Imf::DoubleAttribute(std::get<double>(value)));
  }
  return header;
}

/// Whether DWA compression takes all channels with these last letters for colours.
bool isColour(const std::string& components) {
  return components.find_first_not_of("RGBY") == std::string::npos;
}

/// The channels of a file, and the conversion to what the format can store.
class Channels {
 public:
  Channels(Imf::Header& header, const ExrFormat& format) : header_(header), format_(format) {}

  /// Adds the channels prefix + c for all components c.
  void add(const std::string& prefix, const std::string& components, const Image& image, bool precise) {
    const bool halves = format_.type == ExrFormat::Type::halves && !precise;
    const char* base = halves ? toHalves(image, limitOf(components, halves)) : toFloats(image, components);
    const std::size_t size = halves ? sizeof(Imath::half) : sizeof(float), stride = 3 * size;
    const Imf::PixelType type = halves ? Imf::HALF : Imf::FLOAT;
    for (std::size_t c = 0; c < components.size(); ++c) {
      const std::string name = prefix + components[c];
      header_.channels().insert(name, Imf::Channel(type));
      frame_.insert(name, Imf::Slice(type, const_cast<char*>(base) + c * size, stride, stride * image.width));
    }
  }

  const Imf::FrameBuffer& frame() const { return frame_; }
  std::size_t clamped() const { return clamped_; }

 private:
  float limitOf(const std::string& components, bool halves) const {
    if (format_.isLossy() && isColour(components)) return kLargestDwa;
    return halves ? kLargestHalf : std::numeric_limits<float>::infinity();
  }

  const char* toHalves(const Image& image, float limit) {
    std::vector<Imath::half>& values = halves_.emplace_back();
    values.reserve(3 * image.pixels.size());
    for (const Rgb& pixel : image.pixels)
      for (const float value : pixel) values.emplace_back(clamped(value, limit));
    return reinterpret_cast<const char*>(values.data());
  }

  const char* toFloats(const Image& image, const std::string& components) {
    const float limit = limitOf(components, false);
    if (std::isinf(limit)) return reinterpret_cast<const char*>(image.pixels.data());
    Image& values = floats_.emplace_back(image);
    for (Rgb& pixel : values.pixels)
      for (float& value : pixel) value = clamped(value, limit);
    return reinterpret_cast<const char*>(values.pixels.data());
  }

  float clamped(float value, float limit) {
    if (!std::isfinite(value) || std::abs(value) <= limit) return value;
    ++clamped_;
    return std::copysign(limit, value);
  }

  Imf::Header& header_;
  const ExrFormat& format_;
  Imf::FrameBuffer frame_;
  std::list<std::vector<Imath::half>> halves_;
  std::list<Image> floats_;
  std::size_t clamped_ = 0;
};

/// Collects a file in memory.
class MemoryStream : public Imf::OStream {
 public:
  MemoryStream() : OStream("memory") {}
  void write(const char text[], int size) override {
    const std::size_t end = position_ + static_cast<std::size_t>(size);
    if (bytes_.size() < end) bytes_.resize(end);
    std::memcpy(bytes_.data() + position_, text, static_cast<std::size_t>(size));
    position_ = end;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t position_ = 0;
};

/// Returns the number of clamped values.
std::size_t encodeExr(Imf::OStream& stream, const Image& image, const ImageAttributes& attributes,
                      std::span<const ImageLayer> layers, const ExrFormat& format) {
  Imf::Header header = makeHeader(image, attributes, format);
  Channels channels(header, format);
  channels.add("", "RGB", image, false);
  for (const ImageLayer& layer : layers) channels.add(layer.name + ".", layer.components, layer.image, layer.precise);
  Imf::OutputFile file(stream, header);
  file.setFrameBuffer(channels.frame());
  file.writePixels(image.height);
  return channels.clamped();
}

/// The bytes of a PNG file, or why there are none.
struct PngBytes {
  std::vector<std::byte> bytes;
  std::exception_ptr failure;
};

/// Exceptions must not pass through stb_image_write, which would not release its memory.
void takeBytes(void* context, void* data, int size) {
  auto& png = *static_cast<PngBytes*>(context);
  try {
    const auto* first = static_cast<const std::byte*>(data);
    png.bytes.assign(first, first + size);
  } catch (const std::bad_alloc&) {
    png.failure = std::current_exception();
  }
}

}  // namespace

void checkImageName(const std::filesystem::path& path) {
  const std::string extension = extensionOf(path);
  if (extension != ".exr" && extension != ".png")
    throw std::runtime_error(
        fmt::format("{}: unsupported image format; images are written as .exr or .png", path.string()));
}

bool isExrName(const std::filesystem::path& path) {
  return extensionOf(path) == ".exr";
}

void writePng(const std::filesystem::path& path, int width, int height, const std::vector<std::uint8_t>& rgb) {
  PngBytes png;
  if (width < 1 || height < 1 || !stbi_write_png_to_func(takeBytes, &png, width, height, 3, rgb.data(), 3 * width))
    throw std::runtime_error(fmt::format("{}: the image cannot be encoded as PNG", path.string()));
  if (png.failure) std::rethrow_exception(png.failure);
  writeAtomically(path, std::span<const std::byte>(png.bytes));
}

std::size_t writeImage(const std::filesystem::path& path, const Image& image, const ImageAttributes& attributes,
                       std::span<const ImageLayer> layers, const ExrFormat& format) {
  checkImageName(path);
  if (extensionOf(path) == ".png") {
    writePng(path, image.width, image.height, encodePixels(image));
    return 0;
  }
  MemoryStream stream;
  const std::size_t clamped = nameErrors(path, [&] { return encodeExr(stream, image, attributes, layers, format); });
  writeAtomically(path, stream.bytes());
  return clamped;
}

ImageAttributes readAttributes(const std::filesystem::path& path) {
  ImageAttributes attributes;
  if (!isExrFile(path)) return attributes;
  const std::unique_ptr<const Imf::InputFile> file = openExr(path);
  for (auto entry = file->header().begin(); entry != file->header().end(); ++entry) {
    if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&entry.attribute()))
      attributes[entry.name()] = text->value();
    else if (const auto* number = dynamic_cast<const Imf::DoubleAttribute*>(&entry.attribute()))
      attributes[entry.name()] = number->value();
  }
  return attributes;
}

}  // namespace lobe
