#include "tests/support/json.h"

template class nlohmann::basic_json<>;

nlohmann::json lobe::test::parseJson(const std::string& text) {
  return nlohmann::json::parse(text);
}

std::string Catch::StringMaker<nlohmann::json>::convert(const nlohmann::json& json) {
  return json.dump();
}
