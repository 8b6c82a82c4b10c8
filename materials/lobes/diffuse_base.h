#pragma once
// Internal to materials/: the diffuse base under a dielectric coating, as smooth and rough plastic have it.

#include "materials/texture.h"

namespace lobe {

/// Light that crosses the coating scatters diffusely, and is partly thrown back by the coating from within, again and
/// again. What leaves is colour · T(cosθo) · T(cosθi) / π, T being the coating's transmittance from outside.
struct DiffuseBase {
  TexturePtr reflectance;
  float inverseEta2;  ///< (outside index over inside index)²
  bool nonlinear;     ///< whether the colour saturates by the repeated scattering

  /// internalReflectance: of the coating, for diffuse light from within.
  Rgb colour(const Vec2& uv, float internalReflectance) const {
    const Rgb diffuse = reflectance->eval(uv);
    // A reflectance above 1 may make the series of bounces diverge: it ends where it would be a hundredfold.
    const Rgb repeated = nonlinear ? Rgb((diffuse * internalReflectance).min(0.99f)) : grey(internalReflectance);
    return diffuse * inverseEta2 / (1.0f - repeated);
  }
};

}  // namespace lobe
