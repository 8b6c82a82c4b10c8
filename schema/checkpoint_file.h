#pragma once
// The file format of checkpoints of loberender. See checkpoint.fbs for the meaning of each number.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "schema/container.h"

namespace lobe {

inline constexpr FileFormat kCheckpointFormat{{'C', 'K', 'P', 'T'}, 4, 0};

// Read in place: the layout of these structs equals that of the schema (size checked at compile time, order of the
// fields by a test).
struct StoredPixel {
  std::array<double, 3> sum, squares;
  std::uint32_t count, dropped;
};
struct StoredPass {
  double seconds;
  std::uint64_t particles, records;
  double logLikelihood;  ///< NaN if not known
};
struct StoredPilot {
  double pathVariance, pathCost, productVariance, productCost, limit, seconds;
};
struct StoredLightPathTrial {
  double variance, cost, pathsPerPixel, secondMoment, left, costWithLight, seconds;
};

/// Everything but the film, the illumination and the importance.
struct CheckpointInfo {
  std::vector<std::pair<std::string, std::string>> settings;  ///< names and values
  std::uint32_t width = 0, height = 0;
  double trainingSeconds = 0, renderingSeconds = 0;
  std::vector<StoredPass> passes;
  double undersampledFraction = 0;
  bool learntFractions = false;
  std::vector<std::uint64_t> counters;
  std::optional<StoredPilot> pilot;
  std::optional<StoredLightPathTrial> lightPathTrial;
};

/// The largest film that a file can hold.
inline constexpr std::uint64_t kMaxCheckpointPixels = std::uint64_t{1} << 25;

/// A checkpoint, read and validated. Immutable and move-only.
class CheckpointFile {
 public:
  /// Reads the file and checks its structure and content: one pixel for each place of the film, sums that are finite
  /// and not negative, sample counts that fit an int, times and a number of light paths that are finite and not
  /// negative. Illumination and importance are not checked. Throws std::runtime_error that names the file and the
  /// fault.
  static CheckpointFile open(const std::filesystem::path& path);

  const CheckpointInfo& info() const { return info_; }
  std::span<const StoredPixel> pixels() const { return pixels_; }
  /// The content of an .illum file; empty if the integrator uses none.
  std::span<const std::byte> illumination() const { return illumination_; }
  /// The same for the importance that guides light paths.
  std::span<const std::byte> importance() const { return importance_; }

 private:
  CheckpointFile(FileContent file, const std::filesystem::path& path);
  FileContent file_;
  CheckpointInfo info_;
  std::span<const StoredPixel> pixels_;
  std::span<const std::byte> illumination_, importance_;
};

/// The bytes of a file. Throws std::runtime_error if they are too many for the format.
std::vector<std::byte> encodeCheckpoint(const CheckpointInfo& info, std::span<const StoredPixel> pixels,
                                        std::span<const std::byte> illumination, std::span<const std::byte> importance);

}  // namespace lobe
