#pragma once
// Internal to scenes/: reads the value of an element as a given type.

#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "scenes/mitsuba/transforms.h"

namespace lobe {

/// The value attribute. Throws SceneError when it is missing, or when there is an attribute other than name, value and
/// intent.
inline std::string valueText(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"name", "value", "intent"});
  const pugi::xml_attribute value = node.attribute("value");
  if (!value) context.file.fail(node, fmt::format("<{}> needs a value", node.name()));
  return value.value();
}

/// The value attribute converted by parse(). When that returns nullopt, throws SceneError that says what is wanted.
template <typename T>
T parsedValue(const ReadContext& context, pugi::xml_node node, std::optional<T> (*parse)(std::string_view),
              std::string_view wanted) {
  const std::string value = valueText(context, node);
  if (std::optional<T> result = parse(value)) return *result;
  context.file.fail(node,
                    fmt::format("\"{}\" is not {} (parameter \"{}\")", value, wanted, node.attribute("name").value()));
}

}  // namespace lobe
