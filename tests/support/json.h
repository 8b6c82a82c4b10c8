#pragma once
// JSON in tests. What nlohmann's header takes long to compile is compiled once, in json.cpp.

#include <string>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

extern template class nlohmann::basic_json<>;

namespace lobe::test {

/// Throws an exception if the text is not JSON.
nlohmann::json parseJson(const std::string& text);

}  // namespace lobe::test

/// How CHECK shows values.
template <>
struct Catch::StringMaker<nlohmann::json> {
  static std::string convert(const nlohmann::json& json);
};
