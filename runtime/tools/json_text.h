#pragma once
// JSON as the tools print it.

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace lobe {

/// Text in UTF-8, indented by that many characters a level; −1: in one line. Bytes of names that are invalid UTF-8,
/// which file names and damaged files may contain, are replaced by U+FFFD.
std::string jsonText(const nlohmann::ordered_json& json, int indent = 2);

}  // namespace lobe
