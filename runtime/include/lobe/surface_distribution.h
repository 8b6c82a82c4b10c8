#pragma once
// The sampling distribution of directions at one surface point: a one-sample mixture of BSDF sampling, the illumination
// mixture, and the product of illumination and reflectance (Herholz et al. 2016; sampling the illumination as a third
// strategy and the background component are additions of Lobe). Its density over solid angle is
//
//   p(wi) = bsdfProbability() · p_bsdf(wi) + guidedPdf(wi).
//
// The host renderer combines the sampler and pdf of its BSDF with this class as follows:
//
//   float choice = uniform();
//   const Strategy strategy = distribution.choose(choice);
//   if (strategy == Strategy::bsdf) {
//     wi = bsdf.sample(choice, u);
//   } else if (const auto sample = distribution.sample(strategy, choice, u)) {
//     wi = sample->wi;
//   } else {
//     return 0;  // a sample of value zero
//   }
//   pdf = distribution.bsdfProbability() * bsdf.pdf(wi) + distribution.guidedPdf(wi);
//
// Estimates with this density are unbiased whatever the field has learnt, because the probability of BSDF sampling is
// always positive, provided that the BSDF's own sampler reaches every direction in which the BSDF is positive.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "lobe/cache_set.h"
#include "lobe/field.h"
#include "lobe/types.h"

namespace lobe {

/// A surface point at which a direction is sampled. All vectors are in world space except wo.
struct ShadingPoint {
  Float3 position;
  Float3 normal;   ///< unit geometric normal on the side of the shading normal n
  Float3 s, t, n;  ///< the shading frame: orthonormal; x, y and z axis of local directions; n is the shading normal
  Float3 wo;       ///< unit, in the shading frame, away from the surface; z < 0 if it leaves on the side of −n
};

/// A compiled lobe of the material and its scale at this point.
struct TintedLobe {
  int lobe;    ///< index into the requests that the cache set was opened with
  float tint;  ///< luminance of the colour or texture that multiplies the lobe, ≥ 0
};

/// The non-delta reflection of the BSDF at this point for wo, as far as mixtures represent it.
struct SurfaceReflectance {
  std::span<const TintedLobe> lobes;
  float diffuseAlbedo = 0;  ///< albedo (luminance), ≥ 0, of the part with constant BRDF value, albedo / π
  /// Fraction of the non-delta albedo that is in neither of the above: transmission and lobes without a cache. Values
  /// below 0 count as 0; values above 1, and NaN, as 1.
  float undescribedFraction = 0;
};

/// How directions are sampled at a point, and why.
enum class GuidingDecision : std::uint8_t {
  product,       ///< product, illumination and BSDF
  illumination,  ///< illumination and BSDF: the reflectance is constant, or no caches were given
  undersampled,  ///< illumination and BSDF with probability ½ each: the record has seen too few particles
  tooNarrow,     ///< BSDF only: the lobes are too narrow for mixtures, or no part of the BSDF was described
  uniform,       ///< BSDF only: the incident radiance is nearly constant
  noRecord       ///< BSDF only: no record serves the point, or it has seen no particle with weight
};

/// The BSDF sampling fraction of a record for product sampling before training has learnt a better one.
inline constexpr float kInitialBsdfFraction = 0.20f;

/// The sampling strategies of the one-sample mixture.
enum class Strategy : std::uint8_t { bsdf, product, illumination };

namespace detail {

/// Chooses the first of two alternatives with the given probability: returns whether choice, uniform in [0,1), is less.
/// Rescales choice to be uniform in [0,1) again.
inline bool chooseFirst(float& choice, float probability) {
  constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;
  const bool first = choice < probability;
  const float mapped = first ? choice / probability : probability < 1 ? (choice - probability) / (1 - probability) : 0;
  choice = mapped < kOneMinusEpsilon ? mapped : kOneMinusEpsilon;
  return first;
}

inline Strategy chooseStrategy(float& choice, float bsdfProbability, float productOfGuided) {
  if (chooseFirst(choice, bsdfProbability)) return Strategy::bsdf;
  return chooseFirst(choice, productOfGuided) ? Strategy::product : Strategy::illumination;
}

}  // namespace detail

/// A direction drawn from the illumination or the product.
struct GuidedSample {
  Float3 wi;        ///< unit, in the shading frame, on the side of wo; may be below the geometric surface
  float guidedPdf;  ///< SurfaceDistribution::guidedPdf(wi)
};

/// The distribution at one point. An object takes about 4 kB and allocates no memory; it is meant to live on the stack.
/// It copies the record that it uses, so that later updates of the field, or its destruction, do not affect it. Not
/// thread-safe while describe runs; the const functions may be called from any thread.
class SurfaceDistribution {
 public:
  /// Looks up the record that serves the point. Without one, all directions are left to BSDF sampling.
  SurfaceDistribution(const Field& field, const ShadingPoint& point);
  SurfaceDistribution(const SurfaceDistribution&) = delete;
  SurfaceDistribution& operator=(const SurfaceDistribution&) = delete;

  /// Whether a record serves the point.
  bool hasRecord() const { return hasRecord_; }
  /// Index of the record in the field, below Field::records(). Requires hasRecord().
  std::uint32_t recordIndex() const;

  /// Sets the reflectance and prepares sampling. Must be called exactly once if hasRecord(), and not otherwise.
  /// `caches` is the cache set that the lobes' indices refer to; nullptr disables the product, so that directions are
  /// sampled from illumination and BSDF with probability ½ each (Vorba et al. 2014); if undescribedFraction > 0, only
  /// the remaining fraction is, and the undescribed one by the BSDF. Neither argument is kept. Throws std::out_of_range
  /// if the set has no lobe of such an index.
  void describe(const SurfaceReflectance& reflectance, const LobeCacheSet* caches);

  GuidingDecision decision() const { return decision_; }

  /// The probability of using the BSDF's own sampler (the BSDF sampling fraction), in (0,1]; 1 without a record.
  float bsdfProbability() const { return bsdfProbability_; }

  /// Chooses a strategy with `choice` uniform in [0,1), and rescales `choice` to be uniform in [0,1) again.
  Strategy choose(float& choice) const { return detail::chooseStrategy(choice, bsdfProbability_, productOfGuided_); }

  /// Samples a direction with a strategy that choose returned, other than Strategy::bsdf. choice: uniform in [0,1), as
  /// rescaled by choose; u: uniform in [0,1)². nullopt is a sample of value zero; it must be counted as a sample.
  std::optional<GuidedSample> sample(Strategy strategy, float choice, const Float2& u) const;

  /// The density over solid angle of choosing the illumination or the product and sampling wi with it. wi: unit, in the
  /// shading frame. 0 for directions on the other side of the surface than wo.
  float guidedPdf(const Float3& wi) const;

  /// Estimates the reflected radiance towards wo (luminance, up to a factor that is the same for all points of a
  /// field), for Russian roulette and splitting (Vorba and Křivánek 2016, Rath et al. 2022). albedo: luminance of the
  /// albedo of the whole BSDF, used if describe was called without caches. nullopt if no estimate is available: without
  /// a record, if undescribedFraction > 0, or if training used no photons, from which the irradiance is estimated.
  std::optional<float> reflectedRadiance(float albedo) const;

  /// Whether a direction sampled here is a training sample for the BSDF sampling fraction. If so,
  /// PathRecorder::addVertex needs RecordedVertex::bsdfPdf.
  bool learnsFraction() const;

 private:
  friend class PathRecorder;
  struct Impl;
  static constexpr std::size_t kBytes = 3968, kAlignment = 32;

  Impl& impl();
  const Impl& impl() const;
  bool hasRecord_ = false;
  GuidingDecision decision_ = GuidingDecision::noRecord;
  float bsdfProbability_ = 1;
  float productOfGuided_ = 0;  // the probability of Strategy::product given that the strategy is not bsdf
  alignas(kAlignment) std::byte storage_[kBytes];
};

}  // namespace lobe
