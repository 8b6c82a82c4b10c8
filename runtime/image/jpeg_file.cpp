#include "runtime/image/jpeg_file.h"

#include <memory>
#include <stdexcept>

#include <turbojpeg.h>

#include <fmt/format.h>

namespace lobe {
namespace {

struct DestroyDecoder {
  void operator()(void* decoder) const { tjDestroy(decoder); }
};
using Decoder = std::unique_ptr<void, DestroyDecoder>;

Decoder makeDecoder() {
  Decoder decoder(tjInitDecompress());
  if (!decoder) throw std::runtime_error("the JPEG decoder cannot be initialised");
  return decoder;
}

[[noreturn]] void fail(const Decoder& decoder) {
  throw std::runtime_error(fmt::format("damaged image ({})", tjGetErrorStr2(decoder.get())));
}

const unsigned char* dataOf(std::string_view bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

JpegSize sizeOf(const Decoder& decoder, std::string_view bytes) {
  JpegSize size{};
  int subsampling = 0, colourSpace = 0;
  if (tjDecompressHeader3(decoder.get(), dataOf(bytes), bytes.size(), &size.width, &size.height, &subsampling,
                          &colourSpace) != 0)
    fail(decoder);
  return size;
}

/// libjpeg-turbo only warns about truncated files, as it does about harmless defects, which are accepted.
bool endsTooEarly(const Decoder& decoder) {
  return std::string_view(tjGetErrorStr2(decoder.get())).find("remature end") != std::string_view::npos;
}

}  // namespace

bool startsLikeJpeg(std::string_view bytes) {
  return bytes.starts_with("\xff\xd8\xff");
}

JpegSize sizeOfJpeg(std::string_view bytes) {
  return sizeOf(makeDecoder(), bytes);
}

JpegPixels readJpeg(std::string_view bytes) {
  const Decoder decoder = makeDecoder();
  const auto [width, height] = sizeOf(decoder, bytes);
  JpegPixels pixels{width, height, {}};
  pixels.codes.resize(std::size_t{4} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const int result = tjDecompress2(decoder.get(), dataOf(bytes), bytes.size(), pixels.codes.data(), width, 0, height,
                                   TJPF_RGBA, TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS);
  if (result != 0 && (tjGetErrorCode(decoder.get()) != TJERR_WARNING || endsTooEarly(decoder))) fail(decoder);
  return pixels;
}

}  // namespace lobe
