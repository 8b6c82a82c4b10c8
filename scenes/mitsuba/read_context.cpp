#include "scenes/mitsuba/read_context.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace lobe {

void ReadContext::unsupported(std::ptrdiff_t location, const std::string& kind, std::string_view message,
                              std::string_view consequence) {
  findings.fault(file.where(location), kind, std::string(message), std::string(consequence));
}

void ReadContext::warn(std::ptrdiff_t location, const std::string& kind, std::string_view message) {
  findings.warn(file.where(location), kind, std::string(message));
}

bool ReadContext::attempt(const std::string& consequence, const std::function<void()>& read) {
  try {
    read();
    return true;
  } catch (const SceneError& error) {
    for (const Fault& fault : error.faults()) findings.fault(fault.where, fault.message, fault.message, consequence);
    return false;
  }
}

Nesting::Nesting(const ReadContext& context, pugi::xml_node node, int& depth) : depth_(depth) {
  constexpr int kDeepest = 100;
  if (depth >= kDeepest)
    context.file.fail(node, fmt::format("<{}> elements nested more than {} deep", node.name(), kDeepest));
  ++depth_;
}

std::string typeOf(const ReadContext& context, pugi::xml_node node) {
  const pugi::xml_attribute type = node.attribute("type");
  if (!type) context.file.fail(node, fmt::format("<{}> needs a type", node.name()));
  return type.value();
}

std::string describe(pugi::xml_node node) {
  const pugi::xml_attribute type = node.attribute("type");
  const std::string name = shortened(elementName(node));
  return type ? fmt::format("{} \"{}\"", name, shortened(type.value())) : name;
}

std::string nameOf(pugi::xml_node node) {
  return node.type() == pugi::node_element ? fmt::format("this <{}>", shortened(node.name())) : "this text";
}

std::string_view elementName(pugi::xml_node node) {
  constexpr std::array<std::string_view, 6> kColours = {"rgb", "srgb", "color", "xyz", "spectrum", "blackbody"};
  const std::string_view name = node.name();
  if (node.attribute("type") && !node.attribute("value") && std::ranges::find(kColours, name) != kColours.end())
    return "texture";
  if (name == "camera") return "sensor";
  if (name == "luminaire") return "emitter";
  if (name == "lookAt" || name == "look_at") return "lookat";
  return name;
}

void rejectText(const ReadContext& context, pugi::xml_node node) {
  if (node.type() == pugi::node_element) return;
  constexpr std::string_view kBlanks = " \t\r\n";
  const std::string_view text = node.value();
  const std::size_t begin = std::min(text.find_first_not_of(kBlanks), text.size());
  const std::string_view word = text.substr(begin, text.find_first_of(kBlanks, begin) - begin);
  context.file.fail(SceneFile::location(node) + static_cast<std::ptrdiff_t>(begin),
                    fmt::format("unexpected text \"{}\" between elements", word));
}

void rejectMedium(ReadContext& context, pugi::xml_node node) {
  context.unsupported(node, "medium", "participating media are not supported", "the medium is left out");
}

pugi::xml_node resolveReference(const ReadContext& context, pugi::xml_node ref) {
  const pugi::xml_attribute id = ref.attribute("id");
  if (!id) context.file.fail(ref, "<ref> needs an id");
  const pugi::xml_node target = context.file.byId(id.value());
  if (!target) context.file.fail(ref, fmt::format("there is no element with the id \"{}\"", id.value()));
  return target;
}

}  // namespace lobe
