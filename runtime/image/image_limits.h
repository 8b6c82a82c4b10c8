#pragma once
// Limits on the images that are read, so that damaged headers do not exhaust the memory.

#include <cstdint>
#include <filesystem>

namespace lobe {

/// Images with at most so many pixels are read whatever the size of the file, because they do no harm.
constexpr std::int64_t kHarmlessPixels = std::int64_t{1} << 24;

/// Throws std::runtime_error if the image is empty or has more than 2^27 pixels.
void checkPixelCount(const std::filesystem::path& path, std::int64_t width, std::int64_t height);

/// The same, and throws if a file of this many bytes is too small for the image: even uniform images compress to no
/// more than mostPerByte pixels per byte.
void checkImageSize(const std::filesystem::path& path, std::int64_t width, std::int64_t height, std::uintmax_t bytes,
                    std::uintmax_t mostPerByte = 2000);

}  // namespace lobe
