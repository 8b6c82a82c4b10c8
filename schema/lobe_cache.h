#pragma once
// The file format of BRDF caches (".lobe"), one file per lobe. See lobe.fbs for the meaning of each number.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "schema/container.h"

namespace lobe {

inline constexpr FileFormat kLobeFormat{{'B', 'R', 'D', 'F'}, 3, 0};

// Read in place: the layout of these structs equals that of the schema (size checked at compile time).
struct CacheComponent {
  float weight, meanX, meanY, covXX, covXY, covYY;
};
struct CacheRecord {
  std::uint32_t entry, first, count;
  float integral, albedo, cosineMass, outside, nev, nevCoverage, worstRatio;
};

/// The method by which the records of a cache were fitted; see lobe_fit.h.
enum class FitMethod { automatic, wem, ceres, eq8 };
inline constexpr std::array<const char*, 4> kFitMethodNames{"auto", "wem", "ceres", "eq8"};
inline const char* nameOf(FitMethod method) {
  return kFitMethodNames[static_cast<std::size_t>(method)];
}
std::optional<FitMethod> fitMethodOf(std::string_view name);

/// Largest number of components of a record in a cache, and of samples that a record is fitted to.
inline constexpr std::uint32_t kMaxCacheComponents = 32, kMaxFitSamples = 1 << 24;

struct FitSettings {
  FitMethod method = FitMethod::wem;
  std::uint32_t components = 8;
  std::uint32_t samples = 4096;
  float reduction = 0.1f;
  std::uint32_t revision = 1;
  float quality = 0;      ///< target relative variance (NEV) of the method auto
  bool fixedGrid = true;  ///< whether every entry of the grid has its own record
  bool operator==(const FitSettings&) const = default;
};

/// The metadata of a cache.
struct LobeCacheInfo {
  std::string toolVersion, model, key, summary;
  int modelRevision = 0;
  FitSettings settings;
  std::uint8_t gridKind = 0;  ///< GridKind
  std::uint32_t gridCount = 0;
  bool quarter = false;  ///< directions must be mirrored by Mirror::intoQuadrant, and mixtures mirrored back
};

/// A cache, read and validated. Immutable and move-only.
class LobeCache {
 public:
  /// Reads the file and checks its structure and content: one look-up per grid entry, indices in range, weights that
  /// sum to one, positive definite covariances, finite numbers, settings of the fit in range. Throws std::runtime_error
  /// that names the file and the fault.
  static LobeCache open(const std::filesystem::path& path);
  /// The same for the content of a file that has been read already.
  LobeCache(FileContent file, const std::filesystem::path& path);

  const LobeCacheInfo& info() const { return info_; }
  std::span<const CacheRecord> records() const { return records_; }
  std::span<const CacheComponent> components() const { return components_; }
  std::span<const CacheComponent> components(const CacheRecord& r) const {
    return components_.subspan(r.first, r.count);
  }
  /// The index of the record for an entry of the grid, entry < info().gridCount.
  std::uint32_t lookup(std::uint32_t entry) const { return lookup_[entry]; }
  std::uint64_t hash() const { return header_.hash; }  ///< hash of the whole content
  /// Format version and hash.
  const ContainerHeader& header() const { return header_; }
  std::size_t bytes() const { return file_.bytes().size(); }

 private:
  FileContent file_;
  LobeCacheInfo info_;
  std::span<const CacheRecord> records_;
  std::span<const CacheComponent> components_;
  std::span<const std::uint32_t> lookup_;
  ContainerHeader header_{};
};

/// The file name of a lobe, "MODEL-HASH.lobe". It does not depend on the settings of the fit, so that renderer and
/// fitter always use the same name.
std::string lobeFileName(const std::string& model, const std::string& key);

/// The bytes of a cache file. Equal input gives equal bytes. Throws std::runtime_error if they are too many for the
/// format.
std::vector<std::byte> encodeLobeCache(const LobeCacheInfo& info, std::span<const CacheRecord> records,
                                       std::span<const CacheComponent> components,
                                       std::span<const std::uint32_t> lookup);

}  // namespace lobe
