#pragma once
// Limits the size of all meshes of a scene, because a small file can be named by many shapes, or expand to a large
// mesh.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>

namespace lobe {

/// Limits the triangles and vertices of all meshes that are in memory for a scene: to a number that does no harm, or to
/// 20 for each byte of the mesh files if that is more. A file has about 1 for 10 bytes, and up to a few per byte if it
/// is compressed, so that the limit allows several uses of each file.
class MeshBudget {
 public:
  static constexpr std::uintmax_t kHarmless = std::uintmax_t{1} << 26;

  /// The number of triangles and vertices that is accepted for mesh files of that many bytes.
  static std::uintmax_t limitFor(std::uintmax_t bytes, std::uintmax_t harmless = kHarmless);

  explicit MeshBudget(std::uintmax_t harmless = kHarmless) : harmless_(harmless) {}

  /// Counts a file that is going to be read, once; nothing if it does not exist. Not for several threads.
  void addFile(const std::filesystem::path& path);
  /// Counts a mesh that has been read. Safe for several threads.
  void addMesh(std::uintmax_t triangles, std::uintmax_t vertices) { size_ += triangles + vertices; }
  /// Safe for several threads.
  bool isExceeded() const { return size_ > limit(); }
  /// The message, which names the limit.
  std::string fault() const;

 private:
  std::uintmax_t limit() const { return limitFor(bytes_, harmless_); }

  std::uintmax_t harmless_;
  std::atomic<std::uintmax_t> size_ = 0;
  std::uintmax_t bytes_ = 0;
  std::set<std::string> files_;  // paths as they are named, and canonical ones
};

}  // namespace lobe
