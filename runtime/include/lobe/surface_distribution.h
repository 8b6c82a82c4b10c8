#pragma once
// The distribution of directions at one surface point: a one-sample mixture of BSDF sampling, the illumination mixture
// and the product of illumination and reflectance (Herholz et al. 2016; the third strategy and the background component
// are ours). Its density over solid angle is
//
//   p(wi) = bsdfProbability() · p_bsdf(wi) + guidedPdf(wi),
//
// so that a host needs its own BSDF's sampler and pdf, this class, and a choice between the two:
//
//   float choice = uniform();
//   const Strategy strategy = distribution.choose(choice);
//   wi = strategy == Strategy::bsdf ? bsdf.sample(choice, u) : distribution.sample(strategy, choice, u)->wi;
//   pdf = distribution.bsdfProbability() * bsdf.pdf(wi) + distribution.guidedPdf(wi);
//
// Estimates with this density are unbiased whatever the field has learnt, because the BSDF keeps a part everywhere.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "lobe/cache_set.h"
#include "lobe/field.h"
#include "lobe/types.h"

namespace lobe {

/// Where directions are to be sampled, in world space but for wo.
struct ShadingPoint {
  Float3 position;
  Float3 normal;   ///< unit geometric normal, of the side that the shading normal is on
  Float3 s, t, n;  ///< the shading frame: orthonormal, n is the shading normal
  Float3 wo;       ///< unit, local in that frame; z < 0 on the back
};

/// A compiled lobe and how much of it the material has at this point: luminance of its colour or texture.
struct TintedLobe {
  int lobe;  ///< index into the requests that the cache set was opened with
  float tint;
};

/// The smooth (not delta) part of the BSDF at this point and wo, as far as mixtures describe it.
struct SurfaceReflectance {
  std::span<const TintedLobe> lobes;
  float diffuseAlbedo = 0;        ///< of constant reflection, luminance
  float undescribedFraction = 0;  ///< fraction in [0,1] of the albedo that neither describes: transmission, other lobes
};

/// What was made of a point.
enum class GuidingDecision : std::uint8_t {
  product,       ///< illumination times reflectance
  illumination,  ///< the illumination mixture, because reflectance is constant or no caches were given
  undersampled,  ///< illumination and BSDF half and half: the record has seen few particles
  tooNarrow,     ///< BSDF only: its lobes are too narrow for mixtures, or nothing is described
  uniform,       ///< BSDF only: the illumination is uniform
  noRecord       ///< BSDF only: nothing was learnt here
};

/// The fraction of directions that the product leaves to the BSDF before records have learnt another.
inline constexpr float kInitialBsdfFraction = 0.20f;

/// What found a direction.
enum class Strategy : std::uint8_t { bsdf, product, illumination };

namespace detail {

/// Splits [0,1) at a probability and maps the part that choice falls in to [0,1).
inline bool takePart(float& choice, float probability) {
  constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;
  const bool first = choice < probability;
  const float mapped = first ? choice / probability : probability < 1 ? (choice - probability) / (1 - probability) : 0;
  choice = mapped < kOneMinusEpsilon ? mapped : kOneMinusEpsilon;
  return first;
}

inline Strategy chooseStrategy(float& choice, float bsdfProbability, float productOfGuided) {
  if (takePart(choice, bsdfProbability)) return Strategy::bsdf;
  return takePart(choice, productOfGuided) ? Strategy::product : Strategy::illumination;
}

}  // namespace detail

/// A direction that was not drawn by the BSDF.
struct GuidedSample {
  Float3 wi;        ///< unit, local
  float guidedPdf;  ///< SurfaceDistribution::guidedPdf(wi)
};

/// Some kilobytes without memory on the heap: keep it on the stack. It copies what it needs of the field, so that later
/// updates of the field do not affect it; the cache set outlives it. One thread at a time.
class SurfaceDistribution {
 public:
  /// Looks up the record that serves the point. Without one all directions are the BSDF's.
  SurfaceDistribution(const Field& field, const ShadingPoint& point);
  SurfaceDistribution(const SurfaceDistribution&) = delete;
  SurfaceDistribution& operator=(const SurfaceDistribution&) = delete;

  bool hasRecord() const { return hasRecord_; }

  /// To be called once if hasRecord(). caches: as opened for the lobes' indices; nullptr: no product is made (Vorba et
  /// al. 2014).
  void describe(const SurfaceReflectance& reflectance, const LobeCacheSet* caches);

  GuidingDecision decision() const { return decision_; }

  /// The probability with which the BSDF's own sampler is to be used; positive, 1 without a record.
  float bsdfProbability() const { return bsdfProbability_; }

  /// Chooses with `choice` uniform in [0,1), which is made uniform again for what is chosen.
  Strategy choose(float& choice) const { return detail::chooseStrategy(choice, bsdfProbability_, productOfGuided_); }

  /// A direction by a strategy other than the BSDF; choice and u uniform in [0,1) and [0,1)². nullopt: a sample
  /// of value zero.
  std::optional<GuidedSample> sample(Strategy strategy, float choice, const Float2& u) const;

  /// The part of the density that is not the BSDF's, over solid angle. wi: unit, local.
  float guidedPdf(const Float3& wi) const;

  /// The radiance (luminance, up to a factor that is the same at all points of a field) that leaves towards wo by
  /// reflection, for Russian roulette and splitting. albedo: luminance of the whole BSDF's, used without caches.
  /// nullopt: not known.
  std::optional<float> reflectedRadiance(float albedo) const;

  /// Whether directions sampled here tell a PathRecorder of the BSDF sampling fraction.
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
  float productOfGuided_ = 0;  // the probability of Strategy::product where it is not the BSDF's
  alignas(kAlignment) std::byte storage_[kBytes];
};

}  // namespace lobe
