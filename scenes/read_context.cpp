#include "scenes/read_context.h"

#include <algorithm>

#include <fmt/format.h>

namespace lobe {

void ReadContext::unsupported(std::ptrdiff_t location, const std::string& kind, std::string_view message,
                              std::string_view consequence) {
  if (!options.lenient) file.fail(location, message);
  warn(location, kind, fmt::format("{}: {}", message, consequence));
}

void ReadContext::warn(std::ptrdiff_t location, const std::string& kind, std::string_view message) {
  if (warnedKinds_.insert(kind).second)
    scene.warnings.push_back(fmt::format("{}: {}", file.where(location), message));
}

void ReadContext::note(std::string text) {
  if (std::ranges::find(scene.notes, text) == scene.notes.end()) scene.notes.push_back(std::move(text));
}

std::string typeOf(const ReadContext& context, pugi::xml_node node) {
  const pugi::xml_attribute type = node.attribute("type");
  if (!type) context.file.fail(node, fmt::format("<{}> needs a type", node.name()));
  return type.value();
}

std::string describe(pugi::xml_node node) {
  const pugi::xml_attribute type = node.attribute("type");
  return type ? fmt::format("{} \"{}\"", elementName(node), type.value()) : std::string(elementName(node));
}

std::string_view elementName(pugi::xml_node node) {
  const std::string_view name = node.name();
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
                    fmt::format("text \"{}\" where an element is needed", word));
}

void noteMedium(ReadContext& context) {
  context.note("media are left out: the inside of shapes is clear");
}

pugi::xml_node resolveReference(const ReadContext& context, pugi::xml_node ref) {
  const pugi::xml_attribute id = ref.attribute("id");
  if (!id) context.file.fail(ref, "<ref> needs an id");
  const pugi::xml_node target = context.file.byId(id.value());
  if (!target) context.file.fail(ref, fmt::format("nothing has the id \"{}\"", id.value()));
  return target;
}

}  // namespace lobe
