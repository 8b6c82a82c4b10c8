#pragma once
// Reads parameters of emitted radiance, intensity and irradiance.

#include <string_view>

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// Largest allowed emission: more would overflow when summed over areas, directions and samples.
inline constexpr float kLargestEmission = 1e30f;

/// Throws ParameterError with this name unless the colour, which can be a product of parameters, is an emission:
/// neither negative nor too large nor without a number. what: begins the message.
void checkEmission(const char* name, std::string_view what, const Rgb& colour);

/// The value of an emission parameter. These functions throw ParameterError when the emission is negative (for a
/// texture: on average), too large (for a texture: anywhere) or not a number.
Rgb emission(const Parameters& parameters, const char* name, const Rgb& fallback);
TexturePtr emissionTexture(const Parameters& parameters, const char* name, const Rgb& fallback);
double emissionScale(const Parameters& parameters, const char* name, double fallback);

/// The sampling_weight of a light; 1 if it is not given. Lights are selected by power, so the weight is noted as having
/// no effect, unless it is 0: a light at a point or at infinity can be found only by next-event estimation, and with
/// weight 0 it would contribute nothing. Throws ParameterError.
double readSamplingWeight(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

}  // namespace lobe
