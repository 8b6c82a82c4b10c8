#pragma once
// Internal to materials/: what the two principled models share in reading their parameters and in what these mean.

#include <string>

#include "materials/lobes/microfacet.h"
#include "materials/parameters.h"

namespace lobe {

/// A texture of values in [0,1], as far as its mean tells; else ParameterError.
TexturePtr readWeight(const Parameters& parameters, const std::string& name, float fallback);

/// How often a part is sampled in comparison with others; default 1. ParameterError: not in [0, 1e6].
float readRate(const Parameters& parameters, const std::string& name);

/// The value of such a texture at uv, in [0,1].
float weightOf(const TexturePtr& texture, const Vec2& uv);

/// GGX of this roughness, α being its square, drawn out along local x.
Microfacet principledInterface(float roughness, float anisotropic);

/// The colour at luminance 1; white for black.
Rgb principledHue(const Rgb& colour);

}  // namespace lobe
