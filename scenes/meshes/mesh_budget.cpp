#include "scenes/meshes/mesh_budget.h"

#include <algorithm>
#include <system_error>

#include <fmt/format.h>

namespace lobe {

void MeshBudget::addFile(const std::filesystem::path& path) {
  if (!files_.insert(path.native()).second) return;
  std::error_code error;
  const std::filesystem::path canonical = std::filesystem::canonical(path, error);
  if (error || (canonical.native() != path.native() && !files_.insert(canonical.native()).second)) return;
  const std::uintmax_t size = std::filesystem::file_size(canonical, error);
  if (!error) bytes_ += size;
}

std::string MeshBudget::fault() const {
  return fmt::format(
      "the meshes of the scene have more than {} triangles and vertices together, the limit for {} bytes of mesh files",
      limit(), bytes_);
}

std::uintmax_t MeshBudget::limitFor(std::uintmax_t bytes, std::uintmax_t harmless) {
  constexpr std::uintmax_t kPerByte = 20;
  return std::max(harmless, kPerByte * bytes);
}

}  // namespace lobe
