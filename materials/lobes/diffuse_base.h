#pragma once
// Internal to materials/: the diffuse base under the dielectric coating of smooth and rough plastic.

#include "materials/texture.h"

namespace lobe {

/// Light that enters the coating scatters diffusely, and the coating reflects part of it internally, repeatedly. The
/// resulting BSDF is colour · T(cosθo) · T(cosθi) / π, where T is the transmittance of the coating from outside.
struct DiffuseBase {
  TexturePtr reflectance;
  float inverseEta2;  ///< (outside index over inside index)²
  bool nonlinear;     ///< whether repeated scattering makes the colour more saturated

  /// internalReflectance: of the coating, for diffuse light from inside.
  Rgb colour(const Vec2& uv, float internalReflectance) const {
    const Rgb diffuse = reflectance->eval(uv);
    // The series of bounces may diverge for a reflectance above 1, so its sum is limited to 100.
    const Rgb repeated = nonlinear ? Rgb((diffuse * internalReflectance).min(0.99f)) : grey(internalReflectance);
    return diffuse * inverseEta2 / (1.0f - repeated);
  }
};

}  // namespace lobe
