#include "scenes/mesh_file.h"

#include <fstream>
#include <stdexcept>

namespace lobe {
std::string readBytes(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) throw std::runtime_error("no such file");
  if (!std::filesystem::is_regular_file(path)) throw std::runtime_error("not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot open");
  std::string bytes(std::filesystem::file_size(path), '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) throw std::runtime_error("cannot read");
  return bytes;
}

}  // namespace lobe
