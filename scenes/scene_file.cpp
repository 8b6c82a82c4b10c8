#include "scenes/scene_file.h"

#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "scenes/reader.h"

namespace lobe {
namespace {

std::string readText(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw SceneError(fmt::format("{}: cannot open: {}", path.string(), std::strerror(errno)));
  std::ostringstream text;
  text << file.rdbuf();
  if (!file || std::filesystem::is_directory(path))
    throw SceneError(fmt::format("{}: cannot read, or empty", path.string()));
  return std::move(text).str();
}

bool isNameCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
}

}  // namespace

SceneFile::SceneFile(const std::filesystem::path& path, const std::map<std::string, std::string>& definitions)
    : path_(path), text_(readText(path)), values_(definitions) {
  parse();
  substituteAll();
  checkDefinitionsUsed(definitions);
  indexIds(scene_);
}

void SceneFile::parse() {
  const pugi::xml_parse_result result = document_.load_buffer(text_.data(), text_.size());
  if (!result) {
    // "Error parsing start element tag" and the like, from pugixml's table.
    fail(result.offset, fmt::format("broken XML: {}", result.description()));
  }
  for (const pugi::xml_node node : document_.children()) {
    if (scene_ || std::string_view(node.name()) != "scene")
      fail(node, fmt::format("<{}> where one <scene> is needed", node.name()));
    scene_ = node;
  }
  if (!scene_) fail(0, "there is no <scene>");
}

void SceneFile::substituteAll() {
  for (const pugi::xml_node node : scene_.children("default")) {
    const pugi::xml_attribute name = node.attribute("name"), value = node.attribute("value");
    if (!name || !value) fail(node, "<default> needs a name and a value");
    usedNames_.insert(name.value());
    values_.emplace(name.value(), substituted(value.value(), node));
  }
  substitute(scene_);
}

void SceneFile::substitute(pugi::xml_node node) {
  if (std::string_view(node.name()) == "default") return;
  for (pugi::xml_attribute attribute : node.attributes())
    if (std::strchr(attribute.value(), '$')) attribute.set_value(substituted(attribute.value(), node).c_str());
  for (const pugi::xml_node child : node.children())
    if (child.type() == pugi::node_element) substitute(child);
}

std::string SceneFile::substituted(const std::string& text, pugi::xml_node node) {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    if (text[i] != '$') {
      result += text[i++];
      continue;
    }
    std::size_t end = i + 1;
    while (end < text.size() && isNameCharacter(text[end])) ++end;
    const std::string name = text.substr(i + 1, end - i - 1);
    const auto it = values_.find(name);
    if (it == values_.end())
      fail(node, fmt::format("${} is not defined: neither by a <default> nor by -D{}", name,
                             values_.empty() ? "" : fmt::format("; defined are {}", fmt::join(names(), ", "))));
    usedNames_.insert(name);
    result += it->second;
    i = end;
  }
  return result;
}

void SceneFile::checkDefinitionsUsed(const std::map<std::string, std::string>& definitions) const {
  for (const auto& [name, value] : definitions)
    if (!usedNames_.contains(name))
      fail(scene_, fmt::format("the scene does not use ${}, which -D defines; it uses {}", name,
                               usedNames_.empty() ? "none" : fmt::format("{}", fmt::join(usedNames_, ", "))));
}

std::vector<std::string> SceneFile::names() const {
  std::vector<std::string> result;
  for (const auto& [name, value] : values_) result.push_back(name);
  return result;
}

void SceneFile::indexIds(pugi::xml_node node) {
  for (const pugi::xml_node child : node.children()) {
    if (child.type() != pugi::node_element) continue;
    const std::string id = child.attribute("id").value();
    if (!id.empty() && std::string_view(child.name()) != "ref") {
      const auto [it, isNew] = ids_.emplace(id, child);
      if (!isNew)
        fail(child, fmt::format("the id \"{}\" is taken by the <{}> at {}", id, it->second.name(), where(it->second)));
    }
    indexIds(child);
  }
}

bool SceneFile::isOfToday() const {
  return std::strtol(scene_.attribute("version").value(), nullptr, 10) >= 2;
}

pugi::xml_node SceneFile::byId(const std::string& id) const {
  const auto it = ids_.find(id);
  return it == ids_.end() ? pugi::xml_node() : it->second;
}

std::ptrdiff_t SceneFile::location(pugi::xml_node node) {
  // pugixml points at the name of an element, just after its '<', and at the first character of text.
  const std::ptrdiff_t offset = node.offset_debug();
  return node.type() == pugi::node_element ? offset - 1 : offset;
}

std::string SceneFile::where(std::ptrdiff_t location) const {
  const std::size_t end = std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(location, 0)), text_.size());
  std::size_t begin = text_.starts_with("\xef\xbb\xbf") ? 3 : 0;  // a byte order mark is no character
  int line = 1, column = 1;
  for (std::size_t i = begin; i < end; ++i) {
    if (text_[i] == '\n')
      ++line, column = 1;
    else if ((text_[i] & 0xc0) != 0x80)  // bytes that continue a UTF-8 character do not count
      ++column;
  }
  return fmt::format("{}:{}:{}", path_.string(), line, column);
}

void SceneFile::fail(std::ptrdiff_t location, std::string_view message) const {
  throw SceneError(fmt::format("{}: {}", where(location), message));
}

}  // namespace lobe
