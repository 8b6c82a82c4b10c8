#pragma once
// Parameters that say how much something emits.

#include "materials/parameters.h"

namespace lobe {

/// Throw ParameterError where the emission would be negative (of a texture: on average), or not a number.
Rgb emission(const Parameters& parameters, const char* name, const Rgb& fallback);
TexturePtr emissionTexture(const Parameters& parameters, const char* name, const Rgb& fallback);
double emissionScale(const Parameters& parameters, const char* name, double fallback);

}  // namespace lobe
