#include "scenes/values.h"

#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>

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

}  // namespace

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
  if (text == "true") return true;
  if (text == "false") return false;
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

std::optional<Rgb> parseSrgb(std::string_view text) {
  text = trimmed(text);
  const std::optional<Rgb> encoded = text.starts_with('#') ? parseHexColour(text.substr(1)) : parseColour(text);
  if (!encoded) return std::nullopt;
  return encoded->unaryExpr([](float x) { return fromSrgb(x); }).eval();
}

}  // namespace lobe
