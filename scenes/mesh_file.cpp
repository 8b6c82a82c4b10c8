#include "scenes/mesh_file.h"

#include <fstream>
#include <new>
#include <stdexcept>

#include <fmt/format.h>

namespace lobe {
namespace {

std::string readBytes(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) throw std::runtime_error("no such file");
  if (!std::filesystem::is_regular_file(path)) throw std::runtime_error("not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot open");
  std::string bytes(std::filesystem::file_size(path), '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) throw std::runtime_error("cannot read");
  return bytes;
}

}  // namespace

TriangleMesh readMeshFile(const std::filesystem::path& path, const std::function<TriangleMesh(std::string)>& parse) {
  try {
    return parse(readBytes(path));
  } catch (const std::bad_alloc&) {
    throw std::runtime_error(fmt::format("{}: too large for the memory there is", path.string()));
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("{}: {}", path.string(), e.what()));
  }
}

}  // namespace lobe
