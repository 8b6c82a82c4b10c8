#pragma once
// The interface of every reflectance model. lobe.h defines the local frame and the names of the directions.
//
// A BSDF has a smooth part (eval, sample, pdf) and a delta part (sampleDelta). deltaProbability(wo) is the probability
// with which its own sampler chooses the delta part. A guided sampler can therefore replace the sampling of the smooth
// part and keep that of the delta part:
//   with probability P = deltaProbability: call sampleDelta and divide its weight by P;
//   otherwise: call sample and multiply its pdf by 1 − P.
// All functions are const and safe to call from any thread.

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "materials/lobe.h"
#include "runtime/core/vec.h"

namespace lobe {

struct BsdfSample {
  Vec3 wi;
  Rgb f;      ///< BSDF value without the cosine
  float pdf;  ///< density of the smooth part's sampler over solid angle, > 0
  /// Relative index of refraction, transmitted side over the side of wo; 1 for reflection. f applies to radiance, which
  /// refraction scales by 1/eta²; for flux (photons) use f·eta².
  float eta = 1.0f;
};

struct DeltaSample {
  Vec3 wi;
  Rgb weight;                ///< f·|cosθ| divided by the probability of choosing wi within the delta part
  float eta;                 ///< relative index of refraction as in BsdfSample; 1 for reflection and pass-through
  float probability = 1.0f;  ///< of choosing this component within the delta part
  /// Which component of the delta part this is: a number in [0,1) that is the same at all points of the material and
  /// does not decrease with `choice`.
  double component = 0.0;
};

/// The part of a delta component that passes to the other side of a surface in one direction.
struct DeltaTransmission {
  Vec3 wi;
  Rgb weight;     ///< as DeltaSample::weight, but for the transmission alone: not divided by a probability
  bool straight;  ///< wi is −wo
  float eta = 1;  ///< relative index of refraction as in BsdfSample
};

/// A lobe and its weight in a BSDF: ρ_bsdf ≈ Σ tint_i ρ_i + constant/π, in luminance, for wo above the surface.
struct LobeTint {
  int lobe;  ///< index into Bsdf::lobes()
  float tint;
};

/// Maximum number of lobes at one surface point; LobeMixture has an array of this size. A BSDF may have more lobes in
/// total, because different points of its surface may use different ones.
inline constexpr int kMaxLobes = 4;

struct LobeMixture {
  std::array<LobeTint, kMaxLobes> glossy;
  int glossyCount = 0;
  float constant = 0;  ///< albedo of the constant (diffuse) reflection, luminance
  /// Fraction in [0,1] of the smooth part's albedo that the fields above do not represent: transmission, and reflection
  /// by lobes that cannot be fitted.
  float undescribedFraction = 0;
};

class Bsdf {
 public:
  virtual ~Bsdf() = default;

  /// Value of the smooth part, without the cosine, for any pair of directions, transmission included; never negative,
  /// NaN or infinite. It is the BSDF for radiance that arrives from wi and leaves along wo.
  virtual Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const = 0;

  /// Samples the smooth part; choice and u are uniform in [0,1) and [0,1)². nullopt is a sample of value zero.
  virtual std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const = 0;

  /// Density of sample() over solid angle.
  virtual float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const = 0;

  /// Samples the delta part. nullopt: there is no delta part, or the sample has value zero.
  virtual std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const {
    (void)wo, (void)uv, (void)choice;
    return std::nullopt;
  }

  /// Probability in [0,1] with which the BSDF's own sampler chooses the delta part: 0 without a delta part, 1 if there
  /// is no smooth part.
  virtual float deltaProbability(const Vec3& wo, const Vec2& uv) const {
    (void)wo, (void)uv;
    return 0.0f;
  }

  /// The delta transmission, if it has exactly one direction: that of all samples of sampleDelta on the other side of
  /// the surface. Next-event estimation follows it. nullopt: there is no delta transmission, it has several directions,
  /// or the model does not provide it.
  virtual std::optional<DeltaTransmission> deltaTransmission(const Vec3& wo, const Vec2& uv) const {
    (void)wo, (void)uv;
    return std::nullopt;
  }

  /// The lobes of the smooth part for which caches are fitted; empty for diffuse and purely specular materials.
  virtual std::span<const LobePtr> lobes() const { return {}; }

  /// The smooth reflection at wo as a weighted sum of lobes(), for the side of wo: if wo.z < 0, the lobes are evaluated
  /// with both directions mirrored to z > 0. Zero where nothing is reflected.
  virtual LobeMixture mixture(const Vec3& wo, const Vec2& uv) const = 0;

  /// Approximate directional albedo of the smooth and delta parts together, for demodulation and path termination; too
  /// inaccurate for estimates.
  virtual Rgb albedo(const Vec3& wo, const Vec2& uv) const = 0;

  /// Whether light may pass to the other side of the surface.
  virtual bool transmits() const { return false; }

  /// The shading normal after bump or normal mapping, for the viewing direction wo, given the derivatives of position
  /// with respect to u and v; all in the frame before mapping. UnitZ for models that do not map normals.
  virtual Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const {
    (void)wo, (void)uv, (void)dpdu, (void)dpdv;
    return Vec3::UnitZ();
  }

  /// Whether perturbedNormal may differ from UnitZ.
  virtual bool mapsNormals() const { return false; }

  /// Whether the caller must multiply by the shadowing term of terminatorRoughness2 (adapters/normal_mapping.h), which
  /// softens the bump terminator. eval cannot do so, because it knows only the frame after mapping.
  virtual bool shadowsTerminator() const { return false; }
};

using BsdfPtr = std::shared_ptr<const Bsdf>;

}  // namespace lobe
