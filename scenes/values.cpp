#include "scenes/values.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

bool isUpper(char c) {
  return c >= 'A' && c <= 'Z';
}
bool isLower(char c) {
  return c >= 'a' && c <= 'z';
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

float fromSrgb(float encoded) {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

std::optional<Rgb> parseHexColour(std::string_view digits) {
  unsigned code = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), code, 16);
  if (digits.size() != 6 || error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return Rgb(static_cast<float>(code >> 16), static_cast<float>((code >> 8) & 255), static_cast<float>(code & 255)) /
         255.0f;
}

/// Levenshtein's: the fewest letters to insert, drop or exchange.
std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t exchanged = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({exchanged, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// The nearest of the names; empty when none looks like what is wanted.
std::string_view nearest(std::string_view wanted, std::string_view names) {
  std::string_view best;
  std::size_t least = wanted.size() / 3 + 2;  // to be below
  while (!names.empty()) {
    const std::string_view name = names.substr(0, names.find(", "));
    names.remove_prefix(std::min(name.size() + 2, names.size()));
    const std::size_t distance = editDistance(wanted, name);
    if (distance >= std::min(least, name.size())) continue;
    least = distance;
    best = name;
  }
  return best;
}

}  // namespace

std::string knownAre(std::string_view wanted, std::string_view names) {
  const std::string_view guess = nearest(wanted, names);
  return fmt::format("{}known are {}", guess.empty() ? "" : fmt::format("did you mean {}? ", guess), names);
}

std::string normalisedName(std::string_view name) {
  std::string result;
  for (std::size_t i = 0; i < name.size(); ++i) {
    // A new word starts at a capital after a small letter or digit, and at the last capital of a run before a small
    // one.
    const bool afterWord = i > 0 && !isUpper(name[i - 1]) && name[i - 1] != '_';
    const bool endsRun = i > 0 && isUpper(name[i - 1]) && i + 1 < name.size() && isLower(name[i + 1]);
    if (isUpper(name[i]) && (afterWord || endsRun)) result += '_';
    result += static_cast<char>(std::tolower(static_cast<unsigned char>(name[i])));
  }
  return result;
}

std::optional<double> parseNumber(std::string_view text) {
  text = trimmed(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size() || text.empty()) return std::nullopt;
  // Exporters write numbers like 1e-320; they are as good as zero. What overflows is refused.
  if (error == std::errc::result_out_of_range && text.find("e-") != std::string_view::npos) return 0.0;
  if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<int> parseInteger(std::string_view text) {
  const std::optional<double> value = parseNumber(text);
  if (!value || *value != std::floor(*value) || std::abs(*value) > std::numeric_limits<int>::max()) return std::nullopt;
  return static_cast<int>(*value);
}

std::optional<bool> parseBoolean(std::string_view text) {
  text = trimmed(text);
  if (text == "true" || text == "True") return true;
  if (text == "false" || text == "False") return false;
  return std::nullopt;
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

std::optional<Rgb> parseColour(std::string_view text) {
  const auto values = parseNumbers(text);
  if (!values) return std::nullopt;
  if (values->size() == 1) return grey(static_cast<float>(values->front()));
  if (values->size() != 3) return std::nullopt;
  return Eigen::Array3d(values->data()).cast<float>();
}

Rgb linearOfSrgb(const Rgb& encoded) {
  return encoded.unaryExpr([](float x) { return fromSrgb(x); });
}

std::optional<Rgb> parseSrgb(std::string_view text) {
  text = trimmed(text);
  const std::optional<Rgb> encoded = text.starts_with('#') ? parseHexColour(text.substr(1)) : parseColour(text);
  if (!encoded) return std::nullopt;
  return linearOfSrgb(*encoded);
}

}  // namespace lobe
