#pragma once
// The file format of trained illumination (".illum"). See illumination.fbs for the meaning of each number.

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "schema/lobe_cache.h"

namespace lobe {

inline constexpr FileFormat kIlluminationFormat{{'I', 'L', 'L', 'U'}, 2, 3};

/// A record, read in place: the layout equals that of the schema (size checked at compile time, order of the fields by
/// a test). Its size must not change, because files of the same major version would become unreadable: a further
/// quantity is a vector of its own, like IlluminationFile::likelihoodGain.
struct StoredIllumination {
  std::array<float, 3> position, normal, tangent;
  float radius, background, irradiance, samples, bsdfFraction;
  std::uint32_t first, count;
};

/// Largest number of components of a record in a file.
inline constexpr std::uint32_t kMaxStoredComponents = 8;

struct StoredTrainingSettings {
  std::string from = "both";
  std::uint32_t passes = 0, photons = 0, importons = 0, components = 0;
  std::uint64_t seed = 0;
  bool learntFractions = false;  ///< whether bsdfFraction was learnt for each record
  /// Maximum number of segments of the paths whose light was learnt.
  std::int32_t maxDepth = std::numeric_limits<std::int32_t>::max();
  bool operator==(const StoredTrainingSettings&) const = default;
};

/// The metadata of a file.
struct IlluminationInfo {
  std::string toolVersion, scene;
  std::uint64_t sceneHash = 0;
  StoredTrainingSettings settings;
  std::uint64_t particles = 0;
  double undersampledFraction = 0;
  float unit = 1;
};

/// A file, read and validated. Immutable and move-only.
class IlluminationFile {
 public:
  /// Reads the file and checks its structure and content: indices in range, orthonormal normals and tangents, positive
  /// radii, weights that sum to one, positive definite covariances, finite numbers. Throws std::runtime_error that
  /// names the file and the fault.
  static IlluminationFile open(const std::filesystem::path& path);
  /// The same for the content of a file; path names it in messages.
  static IlluminationFile parse(std::span<const std::byte> bytes, const std::filesystem::path& path);

  const IlluminationInfo& info() const { return info_; }
  std::span<const StoredIllumination> records() const { return records_; }
  std::span<const CacheComponent> components(const StoredIllumination& r) const {
    return components_.subspan(r.first, r.count);
  }
  /// Of one of records(); see illumination.fbs. 0 if not known.
  float likelihoodGain(const StoredIllumination& r) const {
    return likelihoodGains_.empty() ? 0 : likelihoodGains_[static_cast<std::size_t>(&r - records_.data())];
  }
  const ContainerHeader& header() const { return header_; }
  std::size_t bytes() const { return file_.bytes().size(); }

 private:
  IlluminationFile(FileContent file, const std::filesystem::path& path);
  FileContent file_;
  IlluminationInfo info_;
  std::span<const StoredIllumination> records_;
  std::span<const CacheComponent> components_;
  std::span<const float> likelihoodGains_;  // one for each record, or none
  ContainerHeader header_{};
};

/// The bytes of a file. likelihoodGains: one for each record, or none. Equal input gives equal bytes. Throws
/// std::runtime_error if they are too many for the format.
std::vector<std::byte> encodeIllumination(const IlluminationInfo& info, std::span<const StoredIllumination> records,
                                          std::span<const CacheComponent> components,
                                          std::span<const float> likelihoodGains = {});

}  // namespace lobe
