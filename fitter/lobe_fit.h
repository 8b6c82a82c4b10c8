#pragma once
// Fits one record: the mixture of a lobe for one direction wo, by weighted EM and optionally least squares, and its
// quality.
//
// The mixture is fitted to ρ without the cosine (the cosine belongs to the illumination), over the disc of wi.

#include <algorithm>
#include <span>
#include <stdexcept>
#include <vector>

#include "fitter/grade.h"
#include "schema/lobe_cache.h"

namespace lobe {

/// Increased whenever a code change alters the results of a fit; caches of another revision are stale.
inline constexpr std::uint32_t kFitRevision = 4;

// FitMethod::wem: weighted EM; ceres: least squares, FitObjective::product; eq8: least squares by the objective of
// Herholz et al. 2016, Eq. 8; automatic: the cheapest of wem and ceres that meets the quality target (adaptive_fit.h).

struct FittedRecord {
  Mixture mixture;     ///< weights sum to one
  CacheRecord record;  ///< first is 0, count is mixture.size()
  /// See Quality::largerVariance.
  float largerVariance() const { return std::max(record.nev, record.nevCoverage); }
};

/// The error of a lobe that is too narrow for Gaussians in single precision.
class TooNarrow : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Fits mixtures for one direction, reusing the samples of the lobe. Keeps a reference to the lobe.
class DirectionFitter {
 public:
  /// Throws std::runtime_error if the lobe returns numbers that are not finite.
  DirectionFitter(const Lobe& lobe, const Vec3& wo, std::uint32_t samples);

  /// The same as fitLobe, with the number of samples given to the constructor.
  FittedRecord fit(const FitSettings& settings, std::span<const Gaussian> start = {}) const;

 private:
  struct Graded;
  Mixture expectationMaximised(const FitSettings& settings) const;
  Graded graded(Mixture mixture) const;
  Graded refined(const Mixture& start, const FitSettings& settings) const;
  FittedRecord record(Graded best) const;
  const Lobe& lobe_;
  Vec3 wo_;
  std::uint32_t samples_;
  std::vector<LobeDraw> draws_;
  Grader grader_;
};

/// Fits the lobe for wo (unit, z > 0). Deterministic. Where nothing is reflected, the record has integral and albedo 0
/// and one broad component. Least squares starts from weighted EM, or from `start` if it is not empty (the mixture of a
/// neighbouring direction, aligned with wo), whose components keep their order and number. The result of least squares
/// is kept only if its grade (Quality::largerVariance) is better than that of the start. Throws TooNarrow, or another
/// std::runtime_error if the lobe returns numbers that are not finite.
FittedRecord fitLobe(const Lobe& lobe, const Vec3& wo, const FitSettings& settings,
                     std::span<const Gaussian> start = {});

/// A record without Gaussians for a lobe that is left to BSDF sampling: with integral and albedo only. Throws
/// std::runtime_error if the lobe returns numbers that are not finite.
FittedRecord withoutComponents(const Lobe& lobe, const Vec3& wo, std::uint32_t samples);

}  // namespace lobe
