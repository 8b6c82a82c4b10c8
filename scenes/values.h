#pragma once
// The text of attributes as numbers, colours and names. Nothing here knows of files: the caller says where the text
// stood.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "materials/vec.h"

namespace lobe {

/// camelCase to snake_case: toWorld → to_world, intIOR → int_ior, alphaU → alpha_u; snake_case stays.
std::string normalisedName(std::string_view name);

/// A finite number and nothing else but blanks around it.
std::optional<double> parseNumber(std::string_view text);
std::optional<int> parseInteger(std::string_view text);
std::optional<bool> parseBoolean(std::string_view text);  ///< "true" or "false", "True" or "False"

/// Finite numbers separated by blanks or commas; nullopt when anything else is between them.
std::optional<std::vector<double>> parseNumbers(std::string_view text);

/// "known are NAMES", with the nearest of them where the wanted one looks like a slip; names are separated by ", ".
std::string knownAre(std::string_view wanted, std::string_view names);

/// One number (grey) or three.
std::optional<Rgb> parseColour(std::string_view text);

/// The linear colour of a sRGB-encoded one.
Rgb linearOfSrgb(const Rgb& encoded);

/// sRGB-encoded: as parseColour or "#rrggbb"; the result is linear.
std::optional<Rgb> parseSrgb(std::string_view text);

}  // namespace lobe
