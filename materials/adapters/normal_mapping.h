#pragma once
// Internal to materials/: a model that reflects like its nested model, with a different shading normal.

#include "materials/bsdf.h"
#include "materials/parameters.h"

namespace lobe {

class NormalMapping : public Bsdf {
 public:
  /// Corrections that Mitsuba 3.7 makes by default and older versions do not make.
  struct Options {
    /// Rotates a mapped normal that faces away from the viewer by 180° about the unmapped normal.
    bool flipInvalid = false;
    bool shadowTerminator = false;
  };
  /// Reads flip_invalid_normals and use_shadowing_function, which are off by default.
  static Options readOptions(const Parameters& parameters);

  NormalMapping(BsdfPtr nested, const Options& options) : nested_(std::move(nested)), options_(options) {}

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final { return nested_->eval(wo, wi, uv); }
  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const final {
    return nested_->sample(wo, uv, choice, u);
  }
  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const final { return nested_->pdf(wo, wi, uv); }
  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const final {
    return nested_->sampleDelta(wo, uv, choice);
  }
  std::optional<DeltaTransmission> deltaTransmission(const Vec3& wo, const Vec2& uv) const final {
    return nested_->deltaTransmission(wo, uv);
  }
  float deltaProbability(const Vec3& wo, const Vec2& uv) const final { return nested_->deltaProbability(wo, uv); }
  std::span<const LobePtr> lobes() const final { return nested_->lobes(); }
  LobeMixture mixture(const Vec3& wo, const Vec2& uv) const final { return nested_->mixture(wo, uv); }
  Rgb albedo(const Vec3& wo, const Vec2& uv) const final { return nested_->albedo(wo, uv); }
  bool transmits() const final { return nested_->transmits(); }

  Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const final;
  bool mapsNormals() const final { return true; }
  bool shadowsTerminator() const final { return options_.shadowTerminator || nested_->shadowsTerminator(); }

 protected:
  /// The mapped surface: its unit normal, with z > 0, and the derivatives of position with respect to u and v.
  struct Tilted {
    Vec3 normal, dpdu, dpdv;
  };

 private:
  /// nullopt: the map has no valid normal here, and the surface is unchanged.
  virtual std::optional<Tilted> tilted(const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const = 0;

  BsdfPtr nested_;
  Options options_;
};

/// The squared GGX roughness of the microfacets that approximate the relief of a bump or normal map, given the cosine
/// between the mapped and the unmapped normal. Smith's shadowing term for this roughness, with respect to the unmapped
/// normal, removes the hard terminator (Conty Estevez, Lecocq and Stein 2019, "A Microfacet-Based Shadowing Function to
/// Solve the Bump Terminator Problem").
float terminatorRoughness2(float cosine);

}  // namespace lobe
