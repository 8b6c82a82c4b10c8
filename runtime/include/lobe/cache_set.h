#pragma once
// The compiled BRDF caches of a scene. The files are written by the tool lobefit or by compileLobe (lobe/fitting.h);
// they are read once, and all threads share the memory.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace lobe {

class BrdfCaches;

/// A lobe of one of the scene's materials, whose cache file is needed.
struct LobeRequest {
  std::string model, key;  ///< as in LobeFunctions; they determine the file name
  int revision = 1;        ///< revision of the model's code, as in LobeFunctions; a cache of another one is stale
  std::string material;    ///< name of the material, for error messages
};

/// The BRDF caches, read into memory: later changes of the files have no effect. Immutable: all functions may be called
/// from any thread. Copies share their memory. After a move, a set may only be assigned to or destroyed.
class LobeCacheSet {
 public:
  /// Reads the file of every request from the folder; requests for equal lobes share one file. `reduction` ≥ 0: the
  /// Gaussians of each record are merged until the sum of the merge costs would exceed it (Runnalls' cost, Herholz et
  /// al. 2016, Appendix B); 0 merges none. Throws std::runtime_error with a one-line message that lists every missing,
  /// stale or damaged file with its materials and ends with `remedy`, the command that creates the files.
  LobeCacheSet(const std::filesystem::path& folder, std::span<const LobeRequest> requests, const std::string& remedy,
               float reduction = 0);

  /// Total size of the files in bytes.
  std::size_t bytes() const;
  /// Mean number of Gaussians per record; 0 if there are no records.
  double meanComponents() const;
  /// Content hashes of the files, in the order in which the requests first use them.
  std::vector<std::uint64_t> hashes() const;

 private:
  friend class SurfaceDistribution;
  std::shared_ptr<const BrdfCaches> caches_;
};

}  // namespace lobe
