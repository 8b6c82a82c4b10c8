#pragma once
// Internal to materials/: the diffuse reflection of the principled model, split into terms that do not depend on the
// material. Burley, "Physically Based Shading at Disney" (2012) and "Extending the Disney BRDF to a BSDF with
// Integrated Subsurface Scattering" (2015).

#include "runtime/core/vec.h"

namespace lobe {

/// (1 − cosine)⁵, Schlick's weight.
float schlickWeight(float cosine);

/// Terms that are combined according to roughness r and flatness: diffuse() interpolates by flatness between
/// plain + r·retro + r²·retro2 and flat + r·flat1 + r²·flat2. Sheen is separate.
struct PrincipledDiffuse {
  float plain = 0;
  float retro = 0;
  float retro2 = 0;
  float flat = 0;
  float flat1 = 0;
  float flat2 = 0;
  float sheen = 0;

  /// The terms for a pair of directions above the surface, without the cosine. All but sheen include 1/π.
  static PrincipledDiffuse between(const Vec3& wo, const Vec3& wi);

  /// The terms times the cosine, integrated over wi, from a table; cosine is that of wo, in [0,1].
  static PrincipledDiffuse albedo(float cosine);

  float diffuse(float roughness, float flatness) const;

  PrincipledDiffuse& add(const PrincipledDiffuse& other, float weight);
};

}  // namespace lobe
