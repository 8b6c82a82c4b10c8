#pragma once
// The compiled BRDF caches of a scene (files that lobefit or lobe::fitting write), opened once and shared by all
// threads.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace lobe {

class BrdfCaches;

/// A lobe that a material has, and so a cache file that is needed.
struct LobeRequest {
  std::string model, key;  ///< as the lobe was compiled; the file's name follows from them
  int revision;            ///< of the model's code; a cache of another revision is stale
  std::string material;    ///< for messages
};

/// Immutable once opened: const functions may be called from any thread. Copies share the files.
class LobeCacheSet {
 public:
  /// Opens the file of every request in the folder; equal keys share one. Throws std::runtime_error with one line that
  /// names all materials whose cache is missing, stale or damaged, and `remedy`, the command that makes them. Mixtures
  /// are merged up to `reduction` of Runnalls' cost (Herholz et al. 2016, Appendix B); 0 leaves them.
  LobeCacheSet(const std::filesystem::path& folder, std::span<const LobeRequest> requests, const std::string& remedy,
               float reduction = 0);

  std::size_t bytes() const;
  /// Mean number of Gaussians of a record; 0 without records.
  double meanComponents() const;
  /// Content hashes of the files, in the order of first use.
  std::vector<std::uint64_t> hashes() const;

 private:
  friend class SurfaceDistribution;
  std::shared_ptr<const BrdfCaches> caches_;
};

}  // namespace lobe
