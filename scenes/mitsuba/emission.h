#pragma once
// Reads parameters of emitted radiance, intensity and irradiance.

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// Largest allowed emission: more would overflow when summed over areas, directions and samples.
inline constexpr float kLargestEmission = 1e30f;

/// The value of an emission parameter. These functions throw ParameterError when the emission is negative, too large
/// (for a texture: on average) or not a number.
Rgb emission(const Parameters& parameters, const char* name, const Rgb& fallback);
TexturePtr emissionTexture(const Parameters& parameters, const char* name, const Rgb& fallback);
double emissionScale(const Parameters& parameters, const char* name, double fallback);

/// The sampling_weight of a light; 1 if it is not given. Lights are selected by power, so the weight is noted as having
/// no effect, unless it is 0: a light at a point or at infinity can be found only by next-event estimation, and with
/// weight 0 it would contribute nothing. Throws ParameterError.
double readSamplingWeight(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

}  // namespace lobe
