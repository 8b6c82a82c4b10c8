#pragma once
// One record: the mixture of a lobe for one direction wo, by weighted EM or by least squares from there, and how good
// it is.
//
// The mixture is fitted to ρ without the cosine (the cosine belongs to the illumination), over the disc of wi.

#include <span>

#include "materials/lobe.h"
#include "runtime/mixture/gaussian.h"
#include "schema/lobe_cache.h"

namespace lobe {

/// Raised when the code of the fit changes what it returns; caches of another revision are stale.
inline constexpr std::uint32_t kFitRevision = 2;

/// FitSettings::method: as ceres, but with as little as is good enough (see adaptive_fit.h); weighted EM; least squares
/// for the use in a product, by Ceres; least squares by the objective of Herholz et al. 2016, Eq. 8.
inline constexpr const char* kMethodAuto = "auto";
inline constexpr const char* kMethodWem = "wem";
inline constexpr const char* kMethodCeres = "ceres";
inline constexpr const char* kMethodEq8 = "eq8";

/// Throws std::runtime_error that says what there is instead.
void requireMethod(const std::string& method);

/// The share of BSDF sampling in the density that a fit is graded with.
inline constexpr double kDefensiveShare = 0.1;

/// NEV of one sample for f = ρ cosθ against p = 0.1 q + 0.9 G cosθ / ∫ G cosθ dA, q the lobe's own density: the
/// relative variance of f/p. Samples that the sampler rejects count, with f = 0. 0 where nothing is reflected.
struct Quality {
  double nev;       ///< drawn from p
  double coverage;  ///< the same quantity drawn from q, which also sees what the mixture misses
  double worst;     ///< largest f/p of all points visited, in units of ∫ f dω; 0 where nothing is reflected
  Vec3 worstAt;     ///< wi of that point; the normal where nothing is reflected
};

/// Grades any mixture over the disc (weights sum to one) with `samples` points of each density. The points are none of
/// those that fitLobe draws with as many samples.
Quality gradeMixture(const Lobe& lobe, const Vec3& wo, std::span<const Gaussian> mixture, std::uint32_t samples);

struct FittedRecord {
  Mixture mixture;     ///< weights sum to one
  CacheRecord record;  ///< first is 0, count is mixture.size()
};

/// Fits the lobe for wo (unit, z > 0). Deterministic. Where nothing is reflected the record has integral and albedo 0
/// and a broad component. Least squares start from weighted EM, or from `start` where one is given (the mixture of a
/// neighbouring direction, brought to wo), whose components then keep their order and number; what they find is kept
/// only when it grades better than the start. Throws std::runtime_error when the lobe returns numbers that are not
/// finite, or is too sharp, or when there is no such method.
FittedRecord fitLobe(const Lobe& lobe, const Vec3& wo, const FitSettings& settings,
                     std::span<const Gaussian> start = {});

}  // namespace lobe
