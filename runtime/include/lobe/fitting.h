#pragma once
// Compiles a host's own reflectance lobes into the cache files that LobeCacheSet opens. In the target lobe::fitting,
// which needs Ceres; a renderer that uses caches made earlier links lobe::guiding alone.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "lobe/types.h"

namespace lobe {

/// A direction drawn by a lobe's sampler.
struct LobeDirection {
  Float3 wi;
  float pdf;  ///< over solid angle, > 0
};

/// A colourless reflection lobe, given by three functions. Directions are unit, point away from the surface and are
/// local to a frame whose z axis is the normal; both have z > 0. The functions are called from several threads at a
/// time.
struct LobeFunctions {
  /// Short name of the model, part of the file's name: letters, digits, '-' and '_'.
  std::string model;
  /// Everything that evaluate depends on, as text: lobes with equal keys share a cache.
  std::string key;
  /// To be raised when the code of the model changes; a cache of another revision is stale.
  int revision = 1;
  /// Whether the value changes when wo and wi are rotated together about the normal.
  bool anisotropic = false;
  /// Whether the value stays the same when both directions are mirrored in the x axis, and in the y axis. Of
  /// anisotropic lobes that do, a quarter of the directions is fitted.
  bool mirrorSymmetric = false;

  /// The BRDF's value without the cosine, ≥ 0 and finite.
  std::function<double(const Float3& wo, const Float3& wi)> evaluate;
  /// Draws wi from u uniform in [0,1)²; nullopt for a sample of value zero, which counts as a sample.
  std::function<std::optional<LobeDirection>(const Float3& wo, const Float2& u)> sample;
  /// The density of sample over solid angle; 0 where it never draws.
  std::function<float(const Float3& wo, const Float3& wi)> pdf;
};

struct FittingOptions {
  std::filesystem::path folder = "lobes";  ///< of the cache files, made when missing
  /// The relative variance of one sample of the product with uniform light that is good enough for a record.
  float quality = 0.03f;
  int components = 8;  ///< most Gaussians of a record, 1 to 32
  bool force = false;  ///< fit again what is up to date

  /// Throws std::runtime_error that names the field.
  void validate() const;
};

struct CompiledLobe {
  std::filesystem::path file;
  bool fitted;                  ///< false: the file was up to date
  std::size_t records;          ///< mixtures in the file, each for one direction wo
  float worstRelativeVariance;  ///< of a record, as FittingOptions::quality
};

/// Fits the lobe on all cores (as TBB limits them) and writes its cache file, which appears whole or not at all. The
/// bytes do not depend on the number of threads. Throws std::runtime_error that names the lobe or the file when a
/// function returns what it must not, when nothing is reflected from any direction's sampler, or when the file cannot
/// be written.
CompiledLobe compileLobe(const LobeFunctions& lobe, const FittingOptions& options = {});

}  // namespace lobe
