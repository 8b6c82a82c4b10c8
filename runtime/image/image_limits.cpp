#include "runtime/image/image_limits.h"

#include <stdexcept>

#include <fmt/format.h>

namespace lobe {

void checkPixelCount(const std::filesystem::path& path, std::int64_t width, std::int64_t height) {
  if (width <= 0 || height <= 0)
    throw std::runtime_error(fmt::format("{}: an image of {}x{} pixels is empty", path.string(), width, height));
  constexpr std::int64_t kMaxPixels = std::int64_t{1} << 27;
  if (width > kMaxPixels / height)
    throw std::runtime_error(
        fmt::format("{}: its size of {}x{} pixels is over the limit of 2^27 pixels", path.string(), width, height));
}

void checkImageSize(const std::filesystem::path& path, std::int64_t width, std::int64_t height, std::uintmax_t bytes,
                    std::uintmax_t mostPerByte) {
  checkPixelCount(path, width, height);
  if (width * height > kHarmlessPixels && static_cast<std::uintmax_t>(width * height) / mostPerByte > bytes)
    throw std::runtime_error(
        fmt::format("{}: a file of {} bytes cannot contain {}x{} pixels", path.string(), bytes, width, height));
}

}  // namespace lobe
