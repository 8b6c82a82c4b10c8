#pragma once
// Internal to materials/: reflectances, transmittances and opacities among the parameters, which must not exceed 1.

#include <utility>

#include "materials/parameters.h"

namespace lobe {

/// The name of a colour parameter, and its value if the file does not contain it.
struct ReflectanceParameter {
  std::string name;
  Rgb fallback;
};

/// Reads a texture. If a component exceeds 1 somewhere, the parameter ensure_energy_conservation decides: true scales
/// the texture so that its largest component is 0.99, as Mitsuba 0.6 does, with a warning; false leaves it unchanged;
/// without the parameter it is unchanged, with a warning. Throws ParameterError as Parameters::texture.
TexturePtr readReflectance(const Parameters& parameters, const ReflectanceParameter& wanted);

/// The same for two colours whose sum must not exceed 1; both are scaled by the same factor.
std::pair<TexturePtr, TexturePtr> readReflectances(const Parameters& parameters, const ReflectanceParameter& first,
                                                   const ReflectanceParameter& second);

}  // namespace lobe
