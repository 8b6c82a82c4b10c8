#pragma once
// All reflectance models by the names scene files use.

#include <string>
#include <string_view>
#include <vector>

#include "materials/parameters.h"

namespace lobe {

/// Makes the model registered under the type name ("roughplastic"). ParameterError: no such model, or bad parameters.
BsdfPtr makeBsdf(std::string_view type, const Parameters& parameters);

/// The type names makeBsdf knows, sorted.
std::vector<std::string> knownBsdfs();

}  // namespace lobe
