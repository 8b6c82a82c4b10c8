#include "scenes/scene_file.h"

#include <algorithm>
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

/// Before the first character; it is none itself.
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

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

/// FILE:LINE:COLUMN of an offset.
std::string placeIn(const std::filesystem::path& path, std::string_view text, std::size_t offset) {
  const std::size_t end = std::min(offset, text.size());
  int line = 1, column = 1;
  for (std::size_t i = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0; i < end; ++i) {
    if (text[i] == '\n')
      ++line, column = 1;
    else if ((text[i] & 0xc0) != 0x80)  // bytes that continue a UTF-8 character do not count
      ++column;
  }
  return fmt::format("{}:{}:{}", path.string(), line, column);
}

struct Range {
  std::size_t begin, end;
};

/// From behind the '<' of an element's start tag to behind its '>'.
std::size_t endOfTag(std::string_view text, std::size_t begin) {
  char quote = 0;
  for (std::size_t i = begin; i < text.size(); ++i) {
    if (quote)
      quote = text[i] == quote ? 0 : quote;
    else if (text[i] == '"' || text[i] == '\'')
      quote = text[i];
    else if (text[i] == '>')
      return i + 1;
  }
  return text.size();
}

/// What is between the tags of a well-formed file's <scene>.
Range bodyOfScene(std::string_view text, std::size_t root) {
  const std::size_t begin = endOfTag(text, root);
  if (text[begin - 2] == '/') return {begin, begin};
  return {begin, text.rfind("</scene")};
}

/// The first fault of the XML by itself; result stays empty without any.
struct ParseFault {
  std::size_t offset = 0;
  std::string message;
};

/// The only <scene> at the top of a document.
pugi::xml_node sceneIn(const pugi::xml_document& document, const pugi::xml_parse_result& result, ParseFault& fault) {
  // "Error parsing start element tag" and the like, from pugixml's table.
  if (!result) fault = {static_cast<std::size_t>(result.offset), fmt::format("broken XML: {}", result.description())};
  if (!result) return {};
  pugi::xml_node scene;
  for (const pugi::xml_node node : document.children()) {
    if (scene || std::string_view(node.name()) != "scene") {
      fault = {static_cast<std::size_t>(SceneFile::location(node)),
               fmt::format("<{}> where one <scene> is needed", node.name())};
      return {};
    }
    scene = node;
  }
  if (!scene) fault = {0, "there is no <scene>"};
  return scene;
}

}  // namespace

SceneFile::SceneFile(const std::filesystem::path& path, const std::map<std::string, std::string>& definitions)
    : files_{{path, readText(path), 0}}, text_(files_[0].text), segments_{{0, 0, 0}}, values_(definitions) {
  do {
    parse();
    readDefaults();
    readFolders();
  } while (expandInclude());
  substitute(scene_);
  checkDefinitionsUsed(definitions);
  indexIds(scene_);
  indexAliases();
}

void SceneFile::parse() {
  const pugi::xml_parse_result result = document_.load_buffer(text_.data(), text_.size());
  ParseFault fault;
  scene_ = sceneIn(document_, result, fault);
  if (!scene_) fail(static_cast<std::ptrdiff_t>(fault.offset), fault.message);
  checkDepth();
}

/// Everything after this goes down the tree by recursion.
void SceneFile::checkDepth() const {
  constexpr int kDeepest = 1000;
  int depth = 0;
  pugi::xml_node node = scene_;
  do {
    if (node.first_child()) {
      node = node.first_child();
      if (++depth > kDeepest) fail(node, fmt::format("elements are nested more than {} deep", kDeepest));
      continue;
    }
    for (; node != scene_ && !node.next_sibling(); --depth) node = node.parent();
    if (node != scene_) node = node.next_sibling();
  } while (node != scene_);
}

void SceneFile::readDefaults() {
  for (const pugi::xml_node node : scene_.children("default")) {
    const pugi::xml_attribute name = node.attribute("name"), value = node.attribute("value");
    if (!name || !value) fail(node, "<default> needs a name and a value");
    usedNames_.insert(name.value());
    if (!values_.contains(name.value())) values_.emplace(name.value(), substituted(value.value(), node));
  }
}

void SceneFile::readFolders() {
  folders_.clear();
  for (const pugi::xml_node node : scene_.children("path")) {
    const pugi::xml_attribute value = node.attribute("value");
    if (!value) fail(node, "<path> needs a value");
    folders_.push_back(files_[0].path.parent_path() / substituted(value.value(), node));
    if (!std::filesystem::is_directory(folders_.back()))
      fail(node, fmt::format("<path>: there is no folder {}", folders_.back().string()));
  }
}

/// Puts the file of the first <include> in its place. Returns whether there was one.
bool SceneFile::expandInclude() {
  const pugi::xml_node include = scene_.child("include");
  if (!include) return false;
  const auto begin = static_cast<std::size_t>(location(include));
  std::size_t end = endOfTag(text_, begin);
  if (text_[end - 2] != '/') end = endOfTag(text_, text_.find("</include", end));
  splice(begin, end, addFile(include));
  return true;
}

std::size_t SceneFile::addFile(pugi::xml_node include) {
  const pugi::xml_attribute name = include.attribute("filename");
  if (!name) fail(include, "<include> needs a filename");
  const std::filesystem::path path = resolve(substituted(name.value(), include));
  if (!std::filesystem::is_regular_file(path)) fail(include, fmt::format("<include>: no file {}", path.string()));
  const std::size_t parent = segmentAt(static_cast<std::size_t>(location(include))).file;
  for (std::size_t file = parent;; file = files_[file].parent) {
    if (std::filesystem::equivalent(files_[file].path, path))
      fail(include, fmt::format("<include>: {} includes itself", path.string()));
    if (file == 0) break;
  }
  files_.push_back({path, readText(path), parent});
  return files_.size() - 1;
}

/// Replaces what is from begin to before end, all of one segment, by what is in the file's <scene>.
void SceneFile::splice(std::size_t begin, std::size_t end, std::size_t file) {
  const std::string& text = files_[file].text;
  pugi::xml_document document;
  ParseFault fault;
  const pugi::xml_node scene = sceneIn(document, document.load_buffer(text.data(), text.size()), fault);
  if (!scene) throw SceneError(fmt::format("{}: {}", placeIn(files_[file].path, text, fault.offset), fault.message));
  const Range body = bodyOfScene(text, static_cast<std::size_t>(location(scene)));
  const std::size_t length = body.end - body.begin;
  const Segment around = segmentAt(begin);
  std::vector<Segment> segments;
  for (const Segment& segment : segments_)
    if (segment.begin < begin) segments.push_back(segment);
  segments.push_back({begin, file, body.begin});
  segments.push_back({begin + length, around.file, around.offset + (end - around.begin)});
  for (const Segment& segment : segments_)
    if (segment.begin >= end) segments.push_back({segment.begin - end + begin + length, segment.file, segment.offset});
  segments_ = std::move(segments);
  text_.replace(begin, end - begin, text, body.begin, length);
}

const SceneFile::Segment& SceneFile::segmentAt(std::size_t offset) const {
  const auto after =
      std::ranges::upper_bound(segments_, offset, {}, [](const Segment& segment) { return segment.begin; });
  return *(after - 1);
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
    const std::string_view name = child.name();
    if (!id.empty() && name != "ref" && name != "alias") {
      const auto [it, isNew] = ids_.emplace(id, child);
      if (!isNew)
        fail(child, fmt::format("the id \"{}\" is taken by the <{}> at {}", id, it->second.name(), where(it->second)));
    }
    indexIds(child);
  }
}

void SceneFile::indexAliases() {
  for (const pugi::xml_node node : scene_.children("alias")) {
    const std::string id = node.attribute("id").value(), as = node.attribute("as").value();
    if (id.empty() || as.empty()) fail(node, "<alias> needs an id and an as");
    if (!byId(id)) fail(node, fmt::format("nothing has the id \"{}\"", id));
    if (!ids_.emplace(as, byId(id)).second) fail(node, fmt::format("the id \"{}\" is taken", as));
  }
}

std::filesystem::path SceneFile::resolve(const std::string& name) const {
  for (auto folder = folders_.rbegin(); folder != folders_.rend(); ++folder)
    if (std::filesystem::exists(*folder / name)) return *folder / name;
  return files_[0].path.parent_path() / name;
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
  const auto offset = static_cast<std::size_t>(std::max<std::ptrdiff_t>(location, 0));
  const Segment& segment = segmentAt(offset);
  const File& file = files_[segment.file];
  return placeIn(file.path, file.text, segment.offset + (offset - segment.begin));
}

void SceneFile::fail(std::ptrdiff_t location, std::string_view message) const {
  throw SceneError(fmt::format("{}: {}", where(location), message));
}

}  // namespace lobe
