#include "runtime/image/exr_file.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>

#include <fmt/format.h>
#include <openexr.h>

#include "runtime/image/image_limits.h"

namespace lobe {
namespace {

/// Keeps the first fault.
void keepFault(exr_const_context_t context, exr_result_t, const char* message) {
  void* fault = nullptr;
  if (context && exr_get_user_data(context, &fault) == EXR_ERR_SUCCESS && fault)
    if (auto& text = *static_cast<std::string*>(fault); text.empty()) text = message;
}

struct Finish {
  void operator()(exr_context_t context) const { exr_finish(&context); }
};
using Context = std::unique_ptr<std::remove_pointer_t<exr_context_t>, Finish>;

void checkWindow(const std::filesystem::path& path, const exr_attr_box2i_t& window, std::uintmax_t length) {
  // DWA compression keeps 2 bytes for 64 pixels of a channel, and zlib then shortens them by a factor of up to 1032.
  constexpr std::uintmax_t kMostPerByte = 40000;
  constexpr std::int64_t kMostLinesTogether = 256;  // with DWAB compression
  const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1,
                     height = std::int64_t{window.max.y} - window.min.y + 1;
  checkImageSize(path, width, height, length, kMostPerByte);
  checkImageSize(path, width, std::max(height, kMostLinesTogether), length, kMostPerByte);
}

/// OpenEXRCore reports sizes of attributes that do not fit the file or the type, which Imf::InputFile does not.
void checkHeader(const std::filesystem::path& path) {
  std::string fault;
  exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
  options.error_handler_fn = keepFault;
  options.user_data = &fault;
  exr_context_t opened = nullptr;
  const exr_result_t result = exr_start_read(&opened, path.c_str(), &options);
  const Context context(opened);
  if (result != EXR_ERR_SUCCESS && fault.empty()) fault = exr_get_default_error_message(result);
  if (!fault.empty()) throw std::runtime_error(fmt::format("{}: damaged EXR file ({})", path.string(), fault));
  exr_attr_box2i_t data{}, display{};
  // Imf::InputFile reads the first part.
  exr_get_data_window(opened, 0, &data);
  exr_get_display_window(opened, 0, &display);
  const std::uintmax_t length = std::filesystem::file_size(path);
  checkWindow(path, data, length);
  checkWindow(path, display, length);
}

}  // namespace

std::unique_ptr<Imf::InputFile> openExr(const std::filesystem::path& path) {
  checkHeader(path);
  return nameExrErrors(path, [&] { return std::make_unique<Imf::InputFile>(path.c_str()); });
}

}  // namespace lobe
