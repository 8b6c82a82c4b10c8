#pragma once
// All reflectance models, by their type names in scene files.

#include <string>
#include <string_view>
#include <vector>

#include "materials/parameters.h"

namespace lobe {

/// Creates the model of a type name such as "roughplastic". Throws ParameterError for an unknown type or invalid
/// parameters.
BsdfPtr makeBsdf(std::string_view type, const Parameters& parameters);

/// The type names that makeBsdf knows, sorted.
std::vector<std::string> knownBsdfs();

}  // namespace lobe
