#include "runtime/core/numbers.h"

#include <charconv>
#include <cmath>
#include <limits>

namespace lobe {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

}  // namespace

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::optional<double> parseReal(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || error == std::errc::invalid_argument || end != word.data() + word.size()) return std::nullopt;
  if (error != std::errc::result_out_of_range) return value;
  // from_chars leaves the value unchanged for both overflow and underflow; exporters do write numbers like 1e-320.
  const bool tooSmall = word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos;
  return tooSmall ? 0.0 : std::copysign(std::numeric_limits<double>::infinity(), word.starts_with('-') ? -1.0 : 1.0);
}

std::optional<double> parseNumber(std::string_view text) {
  const std::optional<double> value = parseReal(trimmed(text));
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<int> parseInteger(std::string_view text) {
  const std::optional<double> value = parseNumber(text);
  if (!value || *value != std::floor(*value) || std::abs(*value) > std::numeric_limits<int>::max()) return std::nullopt;
  return static_cast<int>(*value);
}

std::optional<std::vector<double>> parseNumbers(std::string_view text) {
  std::vector<double> values;
  bool afterComma = false;
  text = trimmed(text);
  while (!text.empty()) {
    const std::size_t length = std::min(text.find_first_of(" \t\r\n,"), text.size());
    const std::optional<double> value = parseNumber(text.substr(0, length));
    if (!value) return std::nullopt;
    values.push_back(*value);
    text = trimmed(text.substr(length));
    afterComma = text.starts_with(',');
    if (afterComma) text = trimmed(text.substr(1));
  }
  if (afterComma) return std::nullopt;
  return values;
}

}  // namespace lobe
