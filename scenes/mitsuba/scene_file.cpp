#include "scenes/mitsuba/scene_file.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/core/parallel.h"
#include "scenes/mitsuba/file_text.h"

namespace lobe {
namespace {

// Limits on expansion: definitions that use each other, and files that include each other, can grow exponentially.
constexpr std::size_t kLongestValue = 1 << 20, kMostIncludes = 1000, kLongestText = std::size_t{1} << 28;

const std::string& nameOf(const std::string& name) {
  return name;
}
const std::string& nameOf(const std::pair<const std::string, std::string>& definition) {
  return definition.first;
}

/// Up to ten of the names in a container of names or definitions, and the number of others.
std::string listed(const auto& names) {
  constexpr std::size_t kMost = 10;
  std::vector<std::string> some;
  for (auto name = names.begin(); name != names.end() && some.size() < kMost; ++name) some.push_back(nameOf(*name));
  const std::string text = fmt::format("{}", fmt::join(some, ", "));
  return names.size() > kMost ? fmt::format("{} and {} more", text, names.size() - kMost) : text;
}

bool isNameCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
}

/// Offset after the '>' of the start tag whose content begins at `begin`, after its '<'.
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

/// The text between the tags of a well-formed file's <scene>.
TextRange bodyOfScene(std::string_view text, std::size_t root) {
  const std::size_t begin = endOfTag(text, root);
  if (text[begin - 2] == '/') return {begin, begin};
  return {begin, text.rfind("</scene")};
}

/// The first error in the XML; an empty message if there is none.
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
               fmt::format("<{}> at the top level, where only one <scene> is allowed", node.name())};
      return {};
    }
    scene = node;
  }
  if (!scene) fault = {0, "there is no <scene>"};
  return scene;
}

bool equalButForCase(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

/// The only entry of the folder whose name differs at most in case.
std::optional<std::filesystem::path> entryOfSimilarName(const std::filesystem::path& folder, const std::string& name) {
  std::optional<std::filesystem::path> found;
  std::error_code error;
  const std::filesystem::path place = folder.empty() ? "." : folder;
  for (const auto& entry : std::filesystem::directory_iterator(place, error)) {
    if (!equalButForCase(entry.path().filename().string(), name)) continue;
    if (found) return std::nullopt;
    found = folder / entry.path().filename();
  }
  return found;
}

/// The file that the name matches when case and the difference between '/' and '\\' are ignored, as on Windows; nullopt
/// unless there is exactly one.
std::optional<std::filesystem::path> fileOfSimilarName(std::filesystem::path folder, std::string name) {
  std::ranges::replace(name, '\\', '/');
  for (const std::filesystem::path& part : std::filesystem::path(name)) {
    if (part.empty() || part == "." || part == ".." || part == "/" || std::filesystem::exists(folder / part)) {
      folder /= part;
      continue;
    }
    const std::optional<std::filesystem::path> next = entryOfSimilarName(folder, part.string());
    if (!next) return std::nullopt;
    folder = *next;
  }
  return folder;
}

}  // namespace

SceneFile::SceneFile(const std::filesystem::path& path, const std::map<std::string, std::string>& definitions,
                     Findings& findings)
    : findings_(findings),
      files_{{path, readXmlText(path), 0, {}}},
      text_(files_[0].text),
      segments_{{0, 0, 0}},
      values_(definitions) {
  files_[0].lines = indexLines(text_);
  do {
    throwIfCancelled();
    parse();
    readDefaults();
    readFolders();
  } while (expandInclude());
  substitute(scene_);
  indexIds(scene_);
  indexAliases();
}

void SceneFile::parse() {
  const pugi::xml_parse_result result =
      document_.load_buffer(text_.data(), text_.size(), pugi::parse_default, pugi::encoding_utf8);
  ParseFault fault;
  scene_ = sceneIn(document_, result, fault);
  if (!scene_) fail(static_cast<std::ptrdiff_t>(fault.offset), fault.message);
  checkDepth();
}

/// Limits the depth, because everything that follows traverses the tree recursively.
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

void SceneFile::fault(pugi::xml_node node, const std::string& message, const std::string& consequence) {
  findings_.fault(where(node), message, message, consequence);
}

void SceneFile::readDefaults() {
  for (const pugi::xml_node node : scene_.children("default")) {
    const pugi::xml_attribute name = node.attribute("name"), value = node.attribute("value");
    if (!name || !value) {
      fault(node, "<default> needs a name and a value", "it is ignored");
      continue;
    }
    usedNames_.insert(name.value());
    if (!values_.contains(name.value())) values_.emplace(name.value(), substituted(value.value(), node));
  }
}

void SceneFile::readFolders() {
  folders_.clear();
  for (const pugi::xml_node node : scene_.children("path")) {
    const std::filesystem::path folder = resolve(substituted(node.attribute("value").value(), node), location(node));
    if (!node.attribute("value"))
      fault(node, "<path> needs a value", "it is ignored");
    else if (!std::filesystem::is_directory(folder))
      fault(node, fmt::format("<path>: there is no folder {}", folder.string()), "it is ignored");
    else
      folders_.push_back(folder);
  }
}

/// Replaces the first <include> by the content of its file, or removes it when that fails. Returns whether there was
/// one.
bool SceneFile::expandInclude() {
  const pugi::xml_node include = scene_.child("include");
  if (!include) return false;
  const auto begin = static_cast<std::size_t>(location(include));
  std::size_t end = endOfTag(text_, begin);
  if (text_[end - 2] != '/') end = endOfTag(text_, text_.find("</include", end));
  const std::size_t around = segmentAt(begin).file;
  try {
    const std::size_t file = addFile(include);
    if (text_.size() + files_[file].text.size() > kLongestText)
      fail(include, fmt::format("the file with all included files is longer than {} bytes", kLongestText));
    splice(begin, end, {file, bodyOf(file)});
  } catch (const SceneError& error) {
    for (const Fault& fault : error.faults())
      findings_.fault(fault.where, fault.message, fault.message, "the included file is left out");
    splice(begin, end, {around, {0, 0}});
  }
  return true;
}

std::size_t SceneFile::addFile(pugi::xml_node include) {
  const pugi::xml_attribute name = include.attribute("filename");
  if (!name) fail(include, "<include> needs a filename");
  if (files_.size() > kMostIncludes) fail(include, fmt::format("more than {} <include>s", kMostIncludes));
  const std::filesystem::path path = resolve(substituted(name.value(), include), location(include));
  if (!std::filesystem::is_regular_file(path)) fail(include, fmt::format("<include>: no file {}", path.string()));
  const std::size_t parent = segmentAt(static_cast<std::size_t>(location(include))).file;
  for (std::size_t file = parent;; file = files_[file].parent) {
    if (std::filesystem::equivalent(files_[file].path, path))
      fail(include, fmt::format("<include>: {} includes itself", path.string()));
    if (file == 0) break;
  }
  files_.push_back({path, readXmlText(path), parent, {}});
  files_.back().lines = indexLines(files_.back().text);
  return files_.size() - 1;
}

/// The range of the content of the file's <scene> in its text.
TextRange SceneFile::bodyOf(std::size_t file) const {
  const std::string& text = files_[file].text;
  pugi::xml_document document;
  ParseFault fault;
  const pugi::xml_node scene = sceneIn(
      document, document.load_buffer(text.data(), text.size(), pugi::parse_default, pugi::encoding_utf8), fault);
  if (!scene) throw SceneError(placeIn(files_[file].path, text, fault.offset), fault.message);
  return bodyOfScene(text, static_cast<std::size_t>(location(scene)));
}

/// Replaces the range [begin, end), which must be in one segment, by a part of a file.
void SceneFile::splice(std::size_t begin, std::size_t end, const Part& part) {
  const std::size_t length = part.range.end - part.range.begin;
  const Segment around = segmentAt(begin);
  std::vector<Segment> segments;
  for (const Segment& segment : segments_)
    if (segment.begin < begin) segments.push_back(segment);
  if (length > 0) segments.push_back({begin, part.file, part.range.begin});
  segments.push_back({begin + length, around.file, around.offset + (end - around.begin)});
  for (const Segment& segment : segments_)
    if (segment.begin >= end) segments.push_back({segment.begin - end + begin + length, segment.file, segment.offset});
  segments_ = std::move(segments);
  text_.replace(begin, end - begin, files_[part.file].text, part.range.begin, length);
}

const SceneFile::Segment& SceneFile::segmentAt(std::size_t offset) const {
  const auto after =
      std::ranges::upper_bound(segments_, offset, {}, [](const Segment& segment) { return segment.begin; });
  return *(after - 1);
}

void SceneFile::substitute(pugi::xml_node node) {
  if (std::string_view(node.name()) == "default") return;
  throwIfCancelled();
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
      fault(node,
            fmt::format("${} is not defined: neither by a <default> nor by -D{}", name,
                        values_.empty() ? "" : fmt::format("; defined are {}", listed(values_))),
            "the element is left out");
    result += it == values_.end() ? "$" + name : it->second;
    if (result.size() > kLongestValue)
      fail(node, fmt::format("with its $names replaced, a value is longer than {} characters", kLongestValue));
    usedNames_.insert(name);
    i = end;
  }
  substituted_ += result.size();
  if (substituted_ > kLongestText)
    fail(node, fmt::format("with all $names replaced, the values are longer than {} characters", kLongestText));
  return result;
}

void SceneFile::checkDefinitionsUsed(const std::map<std::string, std::string>& definitions,
                                     const SceneFile* other) const {
  for (const auto& [name, value] : definitions)
    if (!uses(name) && !(other && other->uses(name)))
      fail(scene_, fmt::format("-D defines ${}, which the scene does not use; it uses {}", name,
                               usedNames_.empty() ? "none" : listed(usedNames_)));
}

bool SceneFile::hasUndefinedName(pugi::xml_node node) {
  return std::ranges::any_of(node.attributes(), [](pugi::xml_attribute a) { return std::strchr(a.value(), '$'); });
}

void SceneFile::indexIds(pugi::xml_node node) {
  for (const pugi::xml_node child : node.children()) {
    if (child.type() != pugi::node_element) continue;
    throwIfCancelled();
    const std::string id = child.attribute("id").value();
    const std::string_view name = child.name();
    if (!id.empty() && name != "ref" && name != "alias") {
      const auto [it, isNew] = ids_.emplace(id, child);
      if (!isNew)
        fault(child,
              fmt::format("the id \"{}\" is already used by the <{}> at {}", id, it->second.name(), where(it->second)),
              "the first element keeps it");
    }
    indexIds(child);
  }
}

void SceneFile::indexAliases() {
  for (const pugi::xml_node node : scene_.children("alias")) {
    const std::string id = node.attribute("id").value(), as = node.attribute("as").value();
    const std::string consequence = "the alias is ignored";
    if (id.empty() || as.empty())
      fault(node, "<alias> needs the attributes id and as", consequence);
    else if (!byId(id))
      fault(node, fmt::format("there is no element with the id \"{}\"", id), consequence);
    else if (!ids_.emplace(as, byId(id)).second)
      fault(node, fmt::format("the id \"{}\" is already used", as), consequence);
  }
}

std::filesystem::path SceneFile::resolve(const std::string& name, std::ptrdiff_t location) const {
  std::filesystem::path path = find(name, location);
  findings_.addFile(path);
  return path;
}

std::filesystem::path SceneFile::find(const std::string& name, std::ptrdiff_t location) const {
  std::vector<std::filesystem::path> folders(folders_.rbegin(), folders_.rend());
  folders.push_back(files_[0].path.parent_path());
  for (const std::filesystem::path& folder : folders)
    if (std::filesystem::exists(folder / name)) return folder / name;
  for (const std::filesystem::path& folder : folders) {
    const std::optional<std::filesystem::path> similar = fileOfSimilarName(folder, name);
    if (!similar) continue;
    const std::string message =
        fmt::format("{} does not exist: {} is used instead", (folder / name).string(), similar->string());
    findings_.warn(where(location), message, message);
    return *similar;
  }
  return folders.back() / name;
}

int SceneFile::majorVersion() const {
  return static_cast<int>(std::strtol(scene_.attribute("version").value(), nullptr, 10));
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
  return placeIn(file.path, file.text, file.lines, segment.offset + (offset - segment.begin));
}

void SceneFile::fail(std::ptrdiff_t location, std::string_view message) const {
  throw SceneError(where(location), std::string(message));
}

}  // namespace lobe
