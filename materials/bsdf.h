#pragma once
// The interface of every reflectance model. See lobe.h for frame and names of directions.
//
// A BSDF has a smooth part (eval, sample, pdf) and a delta part (sampleDelta). deltaProbability(wo) says how often its
// own sampler takes the delta part, so that a guided sampler can replace the smooth half and leave the delta half
// alone:
//   with probability P = deltaProbability: sampleDelta, its weight to be divided by P;
//   else: sample, its pdf to be multiplied by 1 − P.
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
  float pdf;  ///< over solid angle, of the smooth part's sampler, > 0
  /// Relative index of refraction crossed (1 for reflection): far side over the side of wo. f holds radiance, which
  /// refraction scales by 1/eta²; flux, as of photons, keeps f·eta².
  float eta = 1.0f;
};

struct DeltaSample {
  Vec3 wi;
  Rgb weight;  ///< f·|cosθ| over the probability of the choice made inside the delta part
  float eta;   ///< relative index crossed (1 for reflection and pass-through), as BsdfSample::eta
};

/// How a smooth lobe enters a BSDF: ρ_bsdf ≈ Σ tint_i ρ_i + constant/π, luminances, for wo above the surface.
struct LobeTint {
  int lobe;  ///< index into Bsdf::lobes()
  float tint;
};

/// Most lobes that take part at one point; look-ups use fixed arrays of this size. A BSDF may have more, of which
/// another few matter elsewhere on its surface.
inline constexpr int kMaxLobes = 4;

struct LobeMixture {
  std::array<LobeTint, kMaxLobes> glossy;
  int glossyCount = 0;
  float constant = 0;  ///< albedo of the constant (diffuse) reflection, luminance
  /// Share in [0,1] of the smooth part's albedo that nothing above describes: what goes to the other side of the
  /// surface, and what is reflected by lobes that cannot be fitted.
  float undescribedFraction = 0;
};

class Bsdf {
 public:
  virtual ~Bsdf() = default;

  /// Value of the smooth part, without the cosine, for any pair of directions (wi.z < 0 is transmission); never
  /// negative, NaN or infinite. The radiance convention: for radiance arriving along wi and leaving along wo.
  virtual Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const = 0;

  /// Draws from the smooth part; choice and u are uniform in [0,1) and [0,1)². nullopt: a sample of value zero.
  virtual std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const = 0;

  /// Density of sample over solid angle.
  virtual float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const = 0;

  /// Draws from the delta part. nullopt: no delta part, or a sample of value zero.
  virtual std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const {
    (void)wo, (void)uv, (void)choice;
    return std::nullopt;
  }

  /// The probability in [0,1] with which the BSDF's own sampler takes the delta part: 0 without one, 1 where there is
  /// nothing else.
  virtual float deltaProbability(const Vec3& wo, const Vec2& uv) const {
    (void)wo, (void)uv;
    return 0.0f;
  }

  /// The lobes of the smooth part that are to be fitted; empty for diffuse and for pure delta materials.
  virtual std::span<const LobePtr> lobes() const { return {}; }

  /// The smooth reflection at wo as a mixture of lobes(), for the side that wo is on: the lobes see wo with z > 0 and
  /// give wi on the same side. Zero where nothing is reflected.
  virtual LobeMixture mixture(const Vec3& wo, const Vec2& uv) const = 0;

  /// The directional albedo of everything, approximately: for demodulation and termination, not for estimates.
  virtual Rgb albedo(const Vec3& wo, const Vec2& uv) const = 0;

  /// Whether light may pass to the other side of the surface.
  virtual bool transmits() const { return false; }

  /// The local shading normal after bump or normal mapping, as it is seen from wo, given the derivatives of position by
  /// u and v; all in the frame before mapping. UnitZ for all but the mapping models.
  virtual Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const {
    (void)wo, (void)uv, (void)dpdu, (void)dpdv;
    return Vec3::UnitZ();
  }

  /// Whether perturbedNormal may be other than UnitZ.
  virtual bool mapsNormals() const { return false; }

  /// Whether light that grazes the surface is dimmed according to how far the mapped normal leans, as
  /// terminatorRoughness2 says. The host does that, since eval only knows the frame after mapping.
  virtual bool shadowsTerminator() const { return false; }
};

using BsdfPtr = std::shared_ptr<const Bsdf>;

}  // namespace lobe
