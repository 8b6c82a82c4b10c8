#include "runtime/image/image_output.h"

#include <cmath>
#include <cstring>
#include <span>
#include <stdexcept>

#include <ImfChannelList.h>
#include <ImfDoubleAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <ImfTestFile.h>
#include <fmt/format.h>

#include "runtime/core/atomic_file.h"
#include "runtime/core/colour.h"
#include "runtime/core/files.h"

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#include <stb/stb_image_write.h>

namespace lobe {
namespace {

std::string extensionOf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

std::vector<std::uint8_t> encodePixels(const Image& image) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * image.pixels.size());
  for (const Rgb& pixel : image.pixels)
    for (const float value : pixel) bytes.push_back(static_cast<std::uint8_t>(std::lround(255.0f * encodeSrgb(value))));
  return bytes;
}

Imf::Header makeHeader(const Image& image, const ImageAttributes& attributes) {
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const auto& [name, value] : attributes) {
    if (const auto* text = std::get_if<std::string>(&value))
      header.insert(name, Imf::StringAttribute(*text));
    else
      header.insert(name, Imf::DoubleAttribute(std::get<double>(value)));
  }
  for (const char* channel : {"R", "G", "B"}) header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
  return header;
}

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

void encodeExr(Imf::OStream& stream, const Image& image, const ImageAttributes& attributes) {
  Imf::FrameBuffer frame;
  const char* base = reinterpret_cast<const char*>(image.pixels.data());
  const std::size_t stride = sizeof(Rgb);
  for (int c = 0; c < 3; ++c)
    frame.insert(std::string(1, "RGB"[c]),
                 Imf::Slice(Imf::FLOAT, const_cast<char*>(base) + c * sizeof(float), stride, stride * image.width));
  Imf::OutputFile file(stream, makeHeader(image, attributes));
  file.setFrameBuffer(frame);
  file.writePixels(image.height);
}

void appendBytes(void* context, void* data, int size) {
  auto& bytes = *static_cast<std::vector<std::byte>*>(context);
  const auto* first = static_cast<const std::byte*>(data);
  bytes.insert(bytes.end(), first, first + size);
}

}  // namespace

void checkImageName(const std::filesystem::path& path) {
  const std::string extension = extensionOf(path);
  if (extension != ".exr" && extension != ".png")
    throw std::runtime_error(
        fmt::format("{}: unsupported image format; images are written as .exr or .png", path.string()));
}

void writePng(const std::filesystem::path& path, int width, int height, const std::vector<std::uint8_t>& rgb) {
  std::vector<std::byte> bytes;
  if (!stbi_write_png_to_func(appendBytes, &bytes, width, height, 3, rgb.data(), 3 * width))
    throw std::runtime_error(fmt::format("{}: the image cannot be encoded as PNG", path.string()));
  writeAtomically(path, std::span<const std::byte>(bytes));
}

void writeImage(const std::filesystem::path& path, const Image& image, const ImageAttributes& attributes) {
  checkImageName(path);
  if (extensionOf(path) == ".png") return writePng(path, image.width, image.height, encodePixels(image));
  MemoryStream stream;
  nameErrors(path, [&] { encodeExr(stream, image, attributes); });
  writeAtomically(path, stream.bytes());
}

ImageAttributes readAttributes(const std::filesystem::path& path) {
  ImageAttributes attributes;
  nameErrors(path, [&] { openFile(path); });  // refuses a pipe, which OpenEXR would wait for
  if (!Imf::isOpenExrFile(path.c_str())) return attributes;
  try {
    const Imf::InputFile file(path.c_str());
    for (auto entry = file.header().begin(); entry != file.header().end(); ++entry) {
      if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&entry.attribute()))
        attributes[entry.name()] = text->value();
      else if (const auto* number = dynamic_cast<const Imf::DoubleAttribute*>(&entry.attribute()))
        attributes[entry.name()] = number->value();
    }
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), e.what()));
  }
  return attributes;
}

}  // namespace lobe
