#pragma once
// JSON as the tools print it.

#include <string>

#include <nlohmann/json.hpp>

namespace lobe {

/// Indented text in UTF-8. Bytes of names that are invalid UTF-8, which file names and damaged files may contain, are
/// replaced by U+FFFD.
inline std::string jsonText(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace lobe
