#include "scenes/mitsuba/values.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <numeric>

#include <fmt/format.h>

#include "runtime/core/colour.h"

namespace lobe {
namespace {

bool isUpper(char c) {
  return c >= 'A' && c <= 'Z';
}
bool isLower(char c) {
  return c >= 'a' && c <= 'z';
}

std::optional<Rgb> parseHexColour(std::string_view digits) {
  unsigned code = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), code, 16);
  if (digits.size() != 6 || error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return Rgb(static_cast<float>(code >> 16), static_cast<float>((code >> 8) & 255), static_cast<float>(code & 255)) /
         255.0f;
}

/// Levenshtein distance: the fewest letters to insert, delete or replace.
std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (const char letter : a) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t exchanged = diagonal + (letter == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({exchanged, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// The nearest of the names; empty when none is similar to the wanted one.
std::string_view nearest(std::string_view wanted, std::string_view names) {
  std::string_view best;
  std::size_t least = wanted.size() / 3 + 2;  // exclusive upper bound
  while (!names.empty()) {
    const std::string_view name = names.substr(0, names.find(", "));
    names.remove_prefix(std::min(name.size() + 2, names.size()));
    if (wanted.size() >= 2 * name.size()) continue;  // the distance would be at least the length of the name
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
    // A new word starts at an upper-case letter after a lower-case letter or digit, and at the last upper-case letter
    // of a run that precedes a lower-case one.
    const bool afterWord = i > 0 && !isUpper(name[i - 1]) && name[i - 1] != '_';
    const bool endsRun = i > 0 && isUpper(name[i - 1]) && i + 1 < name.size() && isLower(name[i + 1]);
    if (isUpper(name[i]) && (afterWord || endsRun)) result += '_';
    result += static_cast<char>(std::tolower(static_cast<unsigned char>(name[i])));
  }
  return result;
}

std::optional<bool> parseBoolean(std::string_view text) {
  text = trimmed(text);
  if (text == "true" || text == "True") return true;
  if (text == "false" || text == "False") return false;
  return std::nullopt;
}

std::optional<Rgb> parseColour(std::string_view text) {
  const auto values = parseNumbers(text);
  if (!values) return std::nullopt;
  if (values->size() == 1) return grey(static_cast<float>(values->front()));
  if (values->size() != 3) return std::nullopt;
  return Eigen::Array3d(values->data()).cast<float>();
}

std::optional<Rgb> parseSrgb(std::string_view text) {
  text = trimmed(text);
  const std::optional<Rgb> encoded = text.starts_with('#') ? parseHexColour(text.substr(1)) : parseColour(text);
  if (!encoded) return std::nullopt;
  return decodeSrgb(*encoded);
}

}  // namespace lobe
