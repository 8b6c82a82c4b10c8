#pragma once
// Fits the reflectance lobes of a host renderer and writes the cache files that LobeCacheSet opens. This header belongs
// to the target lobe::fitting, which requires Ceres. A renderer that only uses existing caches needs lobe::guiding
// alone.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "lobe/types.h"

namespace lobe {

/// A direction drawn by the sampler of a lobe.
struct LobeDirection {
  Float3 wi;  ///< unit, in the frame of LobeFunctions
  float pdf;  ///< density over solid angle, > 0 and finite
};

/// A scalar (colourless) reflection lobe of a BSDF, described by three functions. Frame: directions are unit vectors
/// that point away from the surface, in a local frame whose z axis is the normal; wo and wi have z > 0. Threads: the
/// functions are called concurrently.
struct LobeFunctions {
  /// Short name of the model, used in the file name: letters, digits, '-' and '_'.
  std::string model;
  /// All parameters that evaluate depends on, as text. Lobes with equal keys share a cache file.
  std::string key;
  /// Increase it whenever the code of the model changes its values; a cache of another revision is stale.
  int revision = 1;
  /// Whether the value changes when wo and wi are rotated together about the normal.
  bool anisotropic = false;
  /// Whether the value is unchanged when wo and wi are both mirrored in the xz plane, and when both are mirrored in the
  /// yz plane. Only a quarter of the directions of an anisotropic lobe needs to be fitted then.
  bool mirrorSymmetric = false;

  /// The value of the BRDF in 1/sr, without the cosine; ≥ 0 and finite.
  std::function<double(const Float3& wo, const Float3& wi)> evaluate;
  /// Maps u, uniform in [0,1)², to a direction wi. nullopt is a sample of value zero; it counts as a sample.
  std::function<std::optional<LobeDirection>(const Float3& wo, const Float2& u)> sample;
  /// The density of `sample` over solid angle; 0 for directions that it never draws.
  std::function<float(const Float3& wo, const Float3& wi)> pdf;
};

struct FittingOptions {
  std::filesystem::path folder = "lobes";  ///< folder of the cache files; created if it does not exist
  /// Target relative variance (NEV) of a record, > 0: the variance, divided by the squared mean, of the one-sample
  /// estimate of ∫ ρ cosθ dω, the reflection of uniform light. The sample is drawn with probability 0.1 by the sampler
  /// of the lobe, and otherwise from the fitted mixture times cosθ (Herholz et al. 2016, Appendix C).
  float quality = 0.03f;
  int components = 8;  ///< largest number of Gaussians per record, 1 to 32
  bool force = false;  ///< fit again even if the cache file is up to date, or of a newer format

  /// Throws std::runtime_error that names the first field that is out of range.
  void validate() const;
};

/// The result of compileLobe.
struct CompiledLobe {
  std::filesystem::path file;   ///< the cache file
  bool fitted;                  ///< false if the file was already up to date
  std::size_t records;          ///< number of mixtures in the file, each for one direction wo
  float worstRelativeVariance;  ///< largest relative variance of all records, as defined by FittingOptions::quality
};

/// Fits the lobe in parallel (oneTBB; as with Field, a waiting thread runs no other tasks of the host) and writes its
/// cache file atomically; does nothing if the file is up to date. The bytes of the file do not depend on the number
/// of threads. The records of a lobe that reflects nothing or is too narrow for Gaussians have no components; guiding
/// then leaves the lobe to BSDF sampling. Throws std::runtime_error that names the lobe, field or file if a field or
/// option is invalid, if a function returns a value out of range, if `sample` draws nothing although `evaluate` is
/// positive, if the file cannot be written, or if there is a file that cannot be read or has a newer format, unless
/// FittingOptions::force is set; no file is written then. Exceptions of the functions are thrown again.
CompiledLobe compileLobe(const LobeFunctions& lobe, const FittingOptions& options = {});

}  // namespace lobe
