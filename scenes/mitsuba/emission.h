#pragma once
// Parameters that say how much something emits.

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// More would overflow once it is summed over areas, directions and samples.
inline constexpr float kLargestEmission = 1e30f;

/// Throw ParameterError where the emission would be negative, too large (of a texture: on average), or not a number.
Rgb emission(const Parameters& parameters, const char* name, const Rgb& fallback);
TexturePtr emissionTexture(const Parameters& parameters, const char* name, const Rgb& fallback);
double emissionScale(const Parameters& parameters, const char* name, double fallback);

/// Lights are chosen by power, whatever the file would have: sampling_weight is noted as of no effect. What matters is
/// whether it is 0, as nothing but sampling finds light from a point. 1 when there is none. Throws ParameterError.
double readSamplingWeight(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

}  // namespace lobe
