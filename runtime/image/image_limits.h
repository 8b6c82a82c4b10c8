#pragma once
// Limits on the images that are read, so that damaged headers do not exhaust the memory.

#include <cstdint>
#include <filesystem>

namespace lobe {

/// Throws std::runtime_error if the image is empty or has more than 2^27 pixels, or if a file of this many bytes is too
/// small for it: even uniform images compress to no more than mostPerByte pixels per byte.
void checkImageSize(const std::filesystem::path& path, std::int64_t width, std::int64_t height, std::uintmax_t bytes,
                    std::uintmax_t mostPerByte = 2000);

}  // namespace lobe
