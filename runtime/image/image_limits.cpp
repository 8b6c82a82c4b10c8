#include "runtime/image/image_limits.h"

#include <algorithm>
#include <stdexcept>
#include <system_error>

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
        fmt::format("{}: {}x{} pixels in a file of {} bytes are over the limit of {} pixels per byte", path.string(),
                    width, height, bytes, mostPerByte));
}

void PixelBudget::addFile(const std::filesystem::path& path) {
  if (!files_.insert(path).second) return;
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error) bytes_ += size;
}

void PixelBudget::addImage(std::uintmax_t pixels) {
  pixels_ += pixels;
  if (isExceeded()) throw std::runtime_error(fault());
}

std::string PixelBudget::fault() const {
  return fmt::format("the images of the scene have more than {} pixels together, the limit for {} bytes of image files",
                     limit(), bytes_);
}

std::uintmax_t PixelBudget::limit() const {
  constexpr std::uintmax_t kHarmless = std::uintmax_t{1} << 27, kPerByte = 500;
  return std::max(kHarmless, kPerByte * bytes_);
}

}  // namespace lobe
