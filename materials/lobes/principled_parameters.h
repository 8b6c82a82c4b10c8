#pragma once
// Internal to materials/: parameters that both principled models read and interpret in the same way.

#include <string>

#include "materials/lobes/microfacet.h"
#include "materials/parameters.h"

namespace lobe {

/// Reads a texture of values in [0,1]. Throws ParameterError if its mean is outside this interval.
TexturePtr readWeight(const Parameters& parameters, const std::string& name, float fallback);

/// Reads the relative sampling rate of a part; default 1. Throws ParameterError if it is not in [0, 1e6].
float readRate(const Parameters& parameters, const std::string& name);

/// The value at uv of a texture read by readWeight, clamped to [0,1].
float weightOf(const TexturePtr& texture, const Vec2& uv);

/// A GGX distribution with α = roughness², stretched along local x according to anisotropic.
Microfacet principledInterface(float roughness, float anisotropic);

/// The colour scaled to luminance 1; white for black.
Rgb principledHue(const Rgb& colour);

}  // namespace lobe
