#pragma once
// Decimal numbers in text files.

#include <optional>
#include <string_view>
#include <vector>

namespace lobe {

/// The text without blanks (space, tab, CR, LF) at its ends.
std::string_view trimmed(std::string_view text);

/// One decimal number that fills the whole word; a leading plus is allowed. Values too small for a double become zero
/// and values too large infinite. nullopt for anything else.
std::optional<double> parseReal(std::string_view word);

/// A finite number with optional blanks around it.
std::optional<double> parseNumber(std::string_view text);
std::optional<int> parseInteger(std::string_view text);

/// Finite numbers separated by blanks or commas; nullopt when anything else is between them.
std::optional<std::vector<double>> parseNumbers(std::string_view text);

}  // namespace lobe
