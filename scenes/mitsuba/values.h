#pragma once
// Parses the text of attributes as numbers, colours and names. Callers know its location in the file.

#include <optional>
#include <string>
#include <string_view>

#include "runtime/core/numbers.h"
#include "runtime/core/vec.h"

namespace lobe {

/// camelCase to snake_case: toWorld → to_world, intIOR → int_ior, alphaU → alpha_u; snake_case is unchanged.
std::string normalisedName(std::string_view name);

std::optional<bool> parseBoolean(std::string_view text);  ///< "true" or "false", "True" or "False"

/// "known are NAMES", preceded by a suggestion if one of them is similar to the wanted name. The names are separated by
/// a comma and a blank.
std::string knownAre(std::string_view wanted, std::string_view names);

/// One number (grey) or three.
std::optional<Rgb> parseColour(std::string_view text);

/// sRGB-encoded numbers, as for parseColour, or "#rrggbb"; the result is linear.
std::optional<Rgb> parseSrgb(std::string_view text);

}  // namespace lobe
