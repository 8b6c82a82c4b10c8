#include "runtime/core/files.h"

#include <cctype>
#include <cerrno>
#include <system_error>

#include <xxhash.h>

namespace lobe {

std::ifstream openFile(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) throw std::runtime_error("no such file");
  if (error) throw std::runtime_error(fmt::format("cannot open: {}", error.message()));
  if (std::filesystem::is_directory(status)) throw std::runtime_error("is a folder, not a file");
  if (!std::filesystem::is_regular_file(status)) throw std::runtime_error("is not a regular file");
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(fmt::format("cannot open: {}", std::generic_category().message(errno)));
  return file;
}

std::string readFile(const std::filesystem::path& path) {
  std::ifstream file = openFile(path);
  std::string bytes(std::filesystem::file_size(path), '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) throw std::runtime_error("cannot read");
  return bytes;
}

std::string extensionOf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

std::uint64_t contentHash(std::string_view bytes) {
  return XXH3_64bits(bytes.data(), bytes.size());
}

}  // namespace lobe
