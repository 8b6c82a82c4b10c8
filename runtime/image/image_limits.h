#pragma once
// Limits on the images that are read, so that damaged headers do not exhaust the memory.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>

namespace lobe {

/// Images with at most so many pixels are read whatever the size of the file, because they do no harm.
constexpr std::int64_t kHarmlessPixels = std::int64_t{1} << 24;

/// Throws std::runtime_error if the image is empty or has more than 2^27 pixels.
void checkPixelCount(const std::filesystem::path& path, std::int64_t width, std::int64_t height);

/// The same, and throws if the image is not harmless and has more than mostPerByte pixels per byte of its file, as
/// damaged headers claim. The default is more than uniform images compress to, except in PNG files of few bits per
/// pixel and with DWA compression.
void checkImageSize(const std::filesystem::path& path, std::int64_t width, std::int64_t height, std::uintmax_t bytes,
                    std::uintmax_t mostPerByte = 2000);

/// Limits the pixels of all images that are in memory for a scene: to 2^27, or 500 for each byte of their files if that
/// is more.
class PixelBudget {
 public:
  /// Counts a file that is going to be read, once; nothing if it does not exist. Not for several threads.
  void addFile(const std::filesystem::path& path);
  /// Counts the pixels of an image. Throws std::runtime_error that names the limit if it is exceeded. Safe for several
  /// threads.
  void addImage(std::uintmax_t pixels);
  bool isExceeded() const { return pixels_ > limit(); }
  /// The message of the exception.
  std::string fault() const;

 private:
  std::uintmax_t limit() const;

  std::atomic<std::uintmax_t> pixels_ = 0;
  std::uintmax_t bytes_ = 0;
  std::set<std::filesystem::path> files_;
};

}  // namespace lobe
