#include "runtime/image/png_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstdio>
#include <stdexcept>

#include <png.h>

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n";

void onError(png_structp png, png_const_charp message);

void ignoreWarning(png_structp, png_const_charp) {}

/// The state of libpng, and what its callbacks and the steps below share.
struct Decoder {
  explicit Decoder(std::string_view bytes)
      : rest(bytes),
        png(png_create_read_struct(PNG_LIBPNG_VER_STRING, this, onError, ignoreWarning)),
        info(png ? png_create_info_struct(png) : nullptr) {}
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  ~Decoder() { png_destroy_read_struct(&png, &info, nullptr); }

  std::string_view rest;  ///< the bytes that are not read yet
  std::array<char, 100> fault{};
  png_structp png;
  png_infop info;
  png_bytep pixels = nullptr;  ///< for readRows
};

/// Jumps to the call of setjmp in succeeds.
void onError(png_structp png, png_const_charp message) {
  auto& fault = static_cast<Decoder*>(png_get_error_ptr(png))->fault;
  std::snprintf(fault.data(), fault.size(), "%s", message);
  png_longjmp(png, 1);
}

// ---- Steps of decoding. An error jumps out of them, so they must have no variables with destructors.

void readBytes(png_structp png, png_bytep out, std::size_t size) {
  std::string_view& rest = static_cast<Decoder*>(png_get_io_ptr(png))->rest;
  if (size > rest.size()) png_error(png, "it ends too early");
  std::copy_n(rest.data(), size, out);
  rest.remove_prefix(size);
}

/// Reads all chunks before the pixels. The limits of libpng are lifted, because the caller checks the size of the
/// image, and chunks without influence on the pixels are skipped, whatever their size; but a wrong checksum is always
/// an error.
void readHeader(Decoder& decoder) {
  const png_structp png = decoder.png;
  png_set_user_limits(png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
  png_set_chunk_malloc_max(png, 0);
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
  png_set_option(png, PNG_MAXIMUM_INFLATE_WINDOW, PNG_OPTION_ON);  // some files declare a smaller one than they use
  png_set_read_fn(png, &decoder, readBytes);
  png_read_info(png, decoder.info);
}

/// Requests four components of 8 or 16 bits.
void requestCodes(Decoder& decoder) {
  const png_structp png = decoder.png;
  png_set_expand(png);
  png_set_gray_to_rgb(png);
  png_set_add_alpha(png, 0xffff, PNG_FILLER_AFTER);
  if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, decoder.info);
}

void readRows(Decoder& decoder) {
  const std::size_t rowBytes = png_get_rowbytes(decoder.png, decoder.info);
  const png_uint_32 height = png_get_image_height(decoder.png, decoder.info);
  for (int pass = png_set_interlace_handling(decoder.png); pass > 0; --pass)
    for (png_uint_32 y = 0; y < height; ++y) png_read_row(decoder.png, decoder.pixels + y * rowBytes, nullptr);
  png_read_end(decoder.png, nullptr);
}

// ----

using Step = void (*)(Decoder&);

bool succeeds(Decoder& decoder, Step step) {
  if (setjmp(png_jmpbuf(decoder.png)) != 0) return false;
  step(decoder);
  return true;
}

void run(Decoder& decoder, Step step) {
  if (!succeeds(decoder, step)) throw std::runtime_error(fmt::format("damaged image ({})", decoder.fault.data()));
}

PngHeader readHeaderOf(Decoder& decoder) {
  if (!decoder.info) throw std::runtime_error("the PNG decoder cannot be initialised");
  run(decoder, readHeader);
  const png_structp png = decoder.png;
  const png_infop info = decoder.info;
  const bool hasAlpha =
      (png_get_color_type(png, info) & PNG_COLOR_MASK_ALPHA) || png_get_valid(png, info, PNG_INFO_tRNS);
  return {static_cast<int>(png_get_image_width(png, info)), static_cast<int>(png_get_image_height(png, info)),
          png_get_bit_depth(png, info) * png_get_channels(png, info), hasAlpha};
}

template <class T>
std::vector<T> readCodes(Decoder& decoder, int height) {
  std::vector<T> codes(png_get_rowbytes(decoder.png, decoder.info) / sizeof(T) * static_cast<std::size_t>(height));
  decoder.pixels = reinterpret_cast<png_bytep>(codes.data());
  run(decoder, readRows);
  return codes;
}

std::uint32_t bigEndian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes.substr(0, 4)) value = value << 8 | static_cast<std::uint8_t>(byte);
  return value;
}

}  // namespace

bool startsLikePng(std::string_view bytes) {
  return bytes.starts_with(kSignature);
}

PngHeader headerOfPng(std::string_view bytes) {
  Decoder decoder(bytes);
  return readHeaderOf(decoder);
}

PngCodes readPng(std::string_view bytes) {
  Decoder decoder(bytes);
  const int height = readHeaderOf(decoder).height;
  run(decoder, requestCodes);
  if (png_get_bit_depth(decoder.png, decoder.info) == 16) return readCodes<std::uint16_t>(decoder, height);
  return readCodes<std::uint8_t>(decoder, height);
}

std::optional<float> gammaOfPng(std::string_view bytes) {
  constexpr std::size_t kAround = 12;  // bytes around the data of a chunk: length, name and checksum
  std::optional<float> gamma;
  bytes.remove_prefix(kSignature.size());
  while (bytes.size() >= kAround) {
    const std::size_t length = bigEndian(bytes);
    const std::string_view name = bytes.substr(4, 4);
    if (name == "IDAT" || length > bytes.size() - kAround) break;
    if (name == "sRGB") return std::nullopt;
    if (name == "gAMA" && length == 4)
      if (const std::uint32_t value = bigEndian(bytes.substr(8)); value > 0) gamma = 1e5f / static_cast<float>(value);
    bytes.remove_prefix(kAround + length);
  }
  return gamma;
}

}  // namespace lobe
