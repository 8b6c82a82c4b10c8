#pragma once
// One record: the mixture of a lobe for one direction wo, by weighted EM or by least squares from there, and how good
// it is.
//
// The mixture is fitted to ρ without the cosine (the cosine belongs to the illumination), over the disc of wi.

#include <algorithm>
#include <span>
#include <vector>

#include "fitter/grade.h"
#include "schema/lobe_cache.h"

namespace lobe {

/// Raised when the code of the fit changes what it returns; caches of another revision are stale.
inline constexpr std::uint32_t kFitRevision = 3;

// FitMethod::automatic: as ceres, with as little as is good enough (adaptive_fit.h); wem: weighted EM; ceres: least
// squares for the use in a product; eq8: least squares by the objective of Herholz et al. 2016, Eq. 8.

struct FittedRecord {
  Mixture mixture;                                                          ///< weights sum to one
  CacheRecord record;                                                       ///< first is 0, count is mixture.size()
  float worse() const { return std::max(record.nev, record.nevCoverage); }  ///< as Quality::worse
};

/// The fits of one direction, which share what is drawn of the lobe. Keeps a reference to the lobe.
class DirectionFitter {
 public:
  /// Throws std::runtime_error when the lobe returns numbers that are not finite.
  DirectionFitter(const Lobe& lobe, const Vec3& wo, std::uint32_t samples);

  /// As fitLobe, with the samples of the constructor.
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

/// Fits the lobe for wo (unit, z > 0). Deterministic. Where nothing is reflected the record has integral and albedo 0
/// and a broad component. Least squares start from weighted EM, or from `start` where one is given (the mixture of a
/// neighbouring direction, brought to wo), whose components then keep their order and number; what they find is kept
/// only when it grades better than the start (by Quality::worse). Throws std::runtime_error when the lobe returns
/// numbers that are not finite, or is too sharp, or when there is no such method.
FittedRecord fitLobe(const Lobe& lobe, const Vec3& wo, const FitSettings& settings,
                     std::span<const Gaussian> start = {});

}  // namespace lobe
