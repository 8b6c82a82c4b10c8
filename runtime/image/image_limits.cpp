#include "runtime/image/image_limits.h"

#include <stdexcept>

#include <fmt/format.h>

namespace lobe {

void checkImageSize(const std::filesystem::path& path, std::int64_t width, std::int64_t height, std::uintmax_t bytes,
                    std::uintmax_t mostPerByte) {
  // Smaller images are read whatever the file's size, because they do no harm.
  constexpr std::int64_t kMaxPixels = std::int64_t{1} << 27, kLarge = std::int64_t{1} << 24;
  if (width <= 0 || height <= 0 || width > kMaxPixels / height)
    throw std::runtime_error(
        fmt::format("{}: its size of {}x{} pixels is outside the supported range", path.string(), width, height));
  if (width * height > kLarge && static_cast<std::uintmax_t>(width * height) / mostPerByte > bytes)
    throw std::runtime_error(
        fmt::format("{}: a file of {} bytes cannot contain {}x{} pixels", path.string(), bytes, width, height));
}

}  // namespace lobe
