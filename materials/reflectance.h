#pragma once
// Internal to materials/: reflectances, transmittances and opacities among the parameters, which must not exceed 1.

#include <utility>

#include "materials/parameters.h"

namespace lobe {

/// A colour that the file gives by name, or a fallback.
struct ReflectanceParameter {
  std::string name;
  Rgb fallback;
};

/// The texture of the parameter. If one of its components exceeds 1 somewhere, the parameter ensure_energy_conservation
/// decides: true scales the texture so that its largest component is 0.99, as Mitsuba 0.6 does, with a warning; false
/// leaves it as it is; without the parameter there is a warning only. ParameterError as Parameters::texture.
TexturePtr readReflectance(const Parameters& parameters, const ReflectanceParameter& wanted);

/// The same for two colours whose sum is bounded: both are scaled by one factor.
std::pair<TexturePtr, TexturePtr> readReflectances(const Parameters& parameters, const ReflectanceParameter& first,
                                                   const ReflectanceParameter& second);

}  // namespace lobe
