#pragma once
// The text of attributes as numbers, colours and names. Nothing here knows of files: the caller says where the text
// stood.

#include <optional>
#include <string>
#include <string_view>

#include "runtime/core/numbers.h"
#include "runtime/core/vec.h"

namespace lobe {

/// camelCase to snake_case: toWorld → to_world, intIOR → int_ior, alphaU → alpha_u; snake_case stays.
std::string normalisedName(std::string_view name);

std::optional<bool> parseBoolean(std::string_view text);  ///< "true" or "false", "True" or "False"

/// "known are NAMES", with the nearest of them where the wanted one looks like a slip; names are separated by ", ".
std::string knownAre(std::string_view wanted, std::string_view names);

/// One number (grey) or three.
std::optional<Rgb> parseColour(std::string_view text);

/// sRGB-encoded: as parseColour or "#rrggbb"; the result is linear.
std::optional<Rgb> parseSrgb(std::string_view text);

}  // namespace lobe
