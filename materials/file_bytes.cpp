#include "materials/file_bytes.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include <fmt/format.h>
#include <xxhash.h>

namespace lobe {

std::vector<std::byte> readFileBytes(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) throw std::runtime_error(fmt::format("{}: is a folder", path.string()));
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) throw std::runtime_error(fmt::format("{}: cannot open: {}", path.string(), std::strerror(errno)));
  const std::streamoff size = file.tellg();
  if (size < 0) throw std::runtime_error(fmt::format("{}: cannot read", path.string()));
  std::vector<std::byte> bytes(static_cast<std::size_t>(size));
  file.seekg(0);
  if (!file.read(reinterpret_cast<char*>(bytes.data()), size))
    throw std::runtime_error(fmt::format("{}: cannot read", path.string()));
  return bytes;
}

std::uint64_t contentHash(std::span<const std::byte> bytes) {
  return XXH3_64bits(bytes.data(), bytes.size());
}

}  // namespace lobe
