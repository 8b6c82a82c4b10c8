#pragma once
// Internal to materials/: a model under a dielectric coating, as seen from outside.

#include <array>

#include "materials/bsdf.h"
#include "materials/texture.h"

namespace lobe {

/// A model seen through an absorbing layer with a flat dielectric interface on top (Weidlich and Wilkie 2007,
/// "Arbitrarily Layered Micro-Facet Surfaces"): directions are refracted at the interface. Light that the interface
/// reflects internally is lost. The owner multiplies by the transmittance of the interface for both directions. All
/// directions are outside the layer; both sides of the surface are coated.
class CoatedBase {
 public:
  /// eta: index of the layer over that of the outside. depth: absorption coefficient times thickness.
  CoatedBase(BsdfPtr nested, double eta, TexturePtr depth);

  Rgb eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const;
  /// The nested model's sample, refracted out of the layer, with value and density as from eval and pdf. nullopt also
  /// for total internal reflection.
  std::optional<BsdfSample> sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const;
  float pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const;
  std::optional<DeltaSample> sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const;

  /// Approximate directional albedo, split by the parts of the nested model.
  struct Albedo {
    Rgb constant = Rgb::Zero();     ///< of the nested model's diffuse reflection
    Rgb directional = Rgb::Zero();  ///< of its other smooth parts, treated as narrow lobes
    Rgb delta = Rgb::Zero();
    Rgb sum() const { return constant + directional + delta; }
  };
  /// transmittance(|cosθ|) of the interface from outside is included for both directions.
  template <typename Transmittance>
  Albedo albedo(const Vec3& wo, const Vec2& uv, const Transmittance& transmittance) const {
    const std::optional<Vec3> inside = bentInwards(wo);
    if (!inside) return {};
    const float entering = transmittance(std::abs(wo.z()));
    const Rgb depth = depth_->eval(uv);
    Albedo parts = nestedAlbedo(*inside, uv);
    Rgb mean = Rgb::Zero();
    for (const DiffuseRay& ray : diffuseRays_) mean += transmittance(ray.outside) * (-depth / ray.inside).exp();
    const Rgb left = entering * (-depth / std::abs(inside->z())).exp();
    parts.constant *= left * mean * (inverseEta2_ / static_cast<float>(diffuseRays_.size()));
    parts.directional *= left * left;
    parts.delta *= left * left;
    return parts;
  }

  const Bsdf& nested() const { return *nested_; }

 private:
  /// Cosines, outside and inside the layer, of one of several equally weighted rays of diffuse light that leaves it.
  struct DiffuseRay {
    float outside, inside;
  };

  std::optional<Vec3> bentInwards(const Vec3& w) const;
  std::optional<Vec3> bentOutwards(const Vec3& w) const;
  Rgb absorption(const Vec3& oInside, const Vec3& iInside, const Vec2& uv) const;
  Albedo nestedAlbedo(const Vec3& inside, const Vec2& uv) const;

  BsdfPtr nested_;
  double eta_;
  float inverseEta2_;
  TexturePtr depth_;
  std::array<DiffuseRay, 16> diffuseRays_;
};

/// Common base of smooth and rough coatings: transmission and mapped normals are those of the nested model.
class CoatedBsdf : public Bsdf {
 public:
  explicit CoatedBsdf(CoatedBase base) : base_(std::move(base)) {}

  bool transmits() const final { return base_.nested().transmits(); }
  Vec3 perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const final {
    return base_.nested().perturbedNormal(wo, uv, dpdu, dpdv);
  }
  bool mapsNormals() const final { return base_.nested().mapsNormals(); }
  bool shadowsTerminator() const final { return base_.nested().shadowsTerminator(); }

 protected:
  const CoatedBase& base() const { return base_; }

 private:
  CoatedBase base_;
};

}  // namespace lobe
