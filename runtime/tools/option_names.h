#pragma once
// Options of the tools whose value is one of several names, or a number in a range.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include "runtime/core/numbers.h"

namespace lobe {

/// A validator of CLI11 that accepts one of the names and replaces it by its value; names: pairs of a name and an
/// enumerator.
template <class Names>
CLI::Validator oneOf(const Names& names) {
  std::map<std::string, std::string> values;
  std::vector<std::string> all;
  for (const auto& [name, value] : names) {
    values[name] = std::to_string(static_cast<int>(value));
    all.push_back(name);
  }
  const auto replace = [values, all](std::string& text) {
    const auto found = values.find(text);
    if (found == values.end()) return fmt::format("must be one of {}, not '{}'", fmt::join(all, ", "), text);
    text = found->second;
    return std::string();
  };
  return {replace, fmt::format("{{{}}}", fmt::join(all, ","))};
}

/// A validator of CLI11 that accepts numbers from least to most. Unlike CLI::Range, it refuses NaN.
inline CLI::Validator fromTo(double least, double most) {
  const auto check = [least, most](const std::string& text) {
    const std::optional<double> value = parseReal(text);
    if (value && *value >= least && *value <= most) return std::string();
    return fmt::format("must be a number from {:g} to {:g}, not '{}'", least, most, text);
  };
  return {check, fmt::format("FLOAT in [{:g} - {:g}]", least, most)};
}

}  // namespace lobe
