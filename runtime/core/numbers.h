#pragma once
// Parsing of decimal numbers in text.

#include <optional>
#include <string_view>
#include <vector>

namespace lobe {

/// The text without leading and trailing white space (space, tab, CR, LF).
std::string_view trimmed(std::string_view text);

/// Parses a word that consists of one decimal number; a leading plus sign is allowed. Values too small for a double
/// become zero, and values too large become infinite. nullopt if the word is not a number.
std::optional<double> parseReal(std::string_view word);

/// Parses a finite number, or an integer in the range of int, with optional white space around it.
std::optional<double> parseNumber(std::string_view text);
std::optional<int> parseInteger(std::string_view text);

/// Parses finite numbers separated by white space or commas; nullopt if the text contains anything else.
std::optional<std::vector<double>> parseNumbers(std::string_view text);

}  // namespace lobe
