#pragma once
// Whole files of measurements, and what identifies their content.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace lobe {

/// Everything in the file. std::runtime_error names the file and says why it cannot be read.
std::vector<std::byte> readFileBytes(const std::filesystem::path& path);

/// XXH3-64: equal for equal content, wherever the file lies.
std::uint64_t contentHash(std::span<const std::byte> bytes);

}  // namespace lobe
