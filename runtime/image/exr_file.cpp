#include "runtime/image/exr_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <type_traits>

#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <fmt/format.h>
#include <openexr.h>

#include "runtime/core/vec.h"
#include "runtime/image/image_limits.h"

namespace lobe {
namespace {

/// The first fault, without memory of its own: it is set in a callback of a library in C.
using Fault = std::array<char, 256>;

/// OpenEXRCore only warns of these, and Imf::InputFile would allocate memory for a wrong size, or use another copy of
/// the attribute. After a bad header, such as an attribute without a type, OpenEXRCore ignores the attributes that
/// follow. The size of a preview without pixels is right, although OpenEXRCore reports it.
bool isHarmful(exr_result_t code, std::string_view message) {
  const bool isEmptyPreview = message.ends_with("Invalid size for preview 0 x 0");
  return code == EXR_ERR_FILE_BAD_HEADER || (code == EXR_ERR_ATTR_SIZE_MISMATCH && !isEmptyPreview) ||
         message.starts_with("Duplicate copy of required attribute");
}

void keepFault(exr_const_context_t context, exr_result_t code, const char* message) {
  void* data = nullptr;
  if (!context || exr_get_user_data(context, &data) != EXR_ERR_SUCCESS || !data || !isHarmful(code, message)) return;
  auto& fault = *static_cast<Fault*>(data);
  if (fault[0] == 0) std::strncpy(fault.data(), message, fault.size() - 1);
}

struct Finish {
  void operator()(exr_context_t context) const { exr_finish(&context); }
};
using Context = std::unique_ptr<std::remove_pointer_t<exr_context_t>, Finish>;

struct Size {
  explicit Size(const exr_attr_box2i_t& window)
      : width(std::int64_t{window.max.x} - window.min.x + 1), height(std::int64_t{window.max.y} - window.min.y + 1) {}
  std::int64_t width, height;
};

/// The pixels of the data window are in the file.
void checkDataWindow(const std::filesystem::path& path, exr_const_context_t file, const Size& data,
                     std::uintmax_t length) {
  exr_compression_t compression{};
  exr_get_compression(file, 0, &compression);
  // DWA compression stores 64 pixels of a channel in at least 4 bytes, which zlib shortens by a factor of up to 1032.
  const bool isDwa = compression == EXR_COMPRESSION_DWAA || compression == EXR_COMPRESSION_DWAB;
  checkImageSize(path, data.width, data.height, length, isDwa ? 20000 : 2000);
}

/// Pixels of the display window outside the data window take no bytes.
void checkDisplayWindow(const std::filesystem::path& path, const Size& data, const Size& display) {
  // Enough for cropped frames of 8192 x 8192 pixels.
  constexpr std::int64_t kHarmless = std::int64_t{1} << 26, kMostPerPixel = 16;
  checkPixelCount(path, display.width, display.height);
  if (display.width * display.height > std::max(kHarmless, kMostPerPixel * data.width * data.height))
    throw std::runtime_error(
        fmt::format("{}: its display window of {}x{} pixels is over the limit of 2^26 pixels or {} times those of the "
                    "data window, which has {}x{}",
                    path.string(), display.width, display.height, kMostPerPixel, data.width, data.height));
}

/// The size of what OpenEXR decompresses at a time: all channels of some lines, whether the image has them or not, or
/// of a tile. Of tiles it keeps a row.
std::uintmax_t blockBytes(exr_const_context_t file, std::int64_t width) {
  std::uint64_t bytes = 0;
  exr_get_chunk_unpacked_size(file, 0, &bytes);
  exr_storage_t storage{};
  exr_get_storage(file, 0, &storage);
  if (storage != EXR_STORAGE_TILED) return bytes;
  std::uint32_t tileWidth = 0, tileHeight = 0;
  exr_tile_level_mode_t levels{};
  exr_tile_round_mode_t rounding{};
  exr_get_tile_descriptor(file, 0, &tileWidth, &tileHeight, &levels, &rounding);
  return std::max<std::uintmax_t>(bytes, sizeof(Rgb) * static_cast<std::uintmax_t>(width) * tileHeight);
}

void checkBlocks(const std::filesystem::path& path, exr_const_context_t file, std::int64_t width,
                 std::uintmax_t length) {
  // Enough for 256 lines of 16384 pixels with four channels of 32 bits.
  constexpr std::uintmax_t kHarmless = std::uintmax_t{1} << 26, kMostPerByte = 256;
  const std::uintmax_t bytes = blockBytes(file, width), limit = std::max(kHarmless, kMostPerByte * length);
  if (bytes > limit)
    throw std::runtime_error(
        fmt::format("{}: its lines or tiles are compressed in blocks of {} bytes, which is over "
                    "the limit of {} bytes for a file of {} bytes",
                    path.string(), bytes, limit, length));
}

Context openHeader(const std::filesystem::path& path) {
  Fault fault{};
  exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
  options.error_handler_fn = keepFault;
  options.user_data = &fault;
  exr_context_t opened = nullptr;
  const exr_result_t result = exr_start_read(&opened, path.c_str(), &options);
  Context context(opened);
  if (result == EXR_ERR_OUT_OF_MEMORY) throw OutOfMemory(path);
  if (result == EXR_ERR_SUCCESS && fault[0] == 0) return context;
  const char* reason = fault[0] == 0 ? exr_get_default_error_message(result) : fault.data();
  throw std::runtime_error(fmt::format("{}: {} ({})", path.string(),
                                       result == EXR_ERR_FILE_ACCESS ? "cannot read" : "damaged EXR file", reason));
}

/// Deep images take memory for as many samples as their pixels claim.
void checkStorage(const std::filesystem::path& path, exr_const_context_t file) {
  exr_storage_t storage{};
  exr_get_storage(file, 0, &storage);
  if (storage == EXR_STORAGE_DEEP_SCANLINE || storage == EXR_STORAGE_DEEP_TILED)
    throw std::runtime_error(fmt::format("{}: deep EXR images are not supported", path.string()));
}

struct Windows {
  exr_attr_box2i_t data{}, display{};
};

/// OpenEXRCore reports sizes of attributes that do not fit the file or the type, which Imf::InputFile does not. Returns
/// the windows that are within the limits.
Windows checkHeader(const std::filesystem::path& path) {
  const Context context = openHeader(path);
  const exr_context_t opened = context.get();
  checkStorage(path, opened);
  Windows windows;
  // Imf::InputFile reads the first part.
  exr_get_data_window(opened, 0, &windows.data);
  exr_get_display_window(opened, 0, &windows.display);
  const std::uintmax_t length = std::filesystem::file_size(path);
  const Size size(windows.data);
  checkDataWindow(path, opened, size, length);
  checkDisplayWindow(path, size, Size(windows.display));
  checkBlocks(path, opened, size.width, length);
  return windows;
}

bool isEqual(const exr_attr_box2i_t& a, const Imath::Box2i& b) {
  return a.min.x == b.min.x && a.min.y == b.min.y && a.max.x == b.max.x && a.max.y == b.max.y;
}

}  // namespace

std::unique_ptr<Imf::InputFile> openExr(const std::filesystem::path& path) {
  const Windows checked = checkHeader(path);
  std::unique_ptr<Imf::InputFile> file =
      nameExrErrors(path, [&] { return std::make_unique<Imf::InputFile>(path.c_str()); });
  // The libraries may take different bytes of a damaged header for the windows.
  if (!isEqual(checked.data, file->header().dataWindow()) || !isEqual(checked.display, file->header().displayWindow()))
    throw std::runtime_error(fmt::format("{}: damaged EXR file (its windows are ambiguous)", path.string()));
  return file;
}

}  // namespace lobe
