#include "scenes/mitsuba/scene_file.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/core/parallel.h"
#include "scenes/mitsuba/file_text.h"

namespace lobe {
namespace {

// Limits on expansion: definitions that use each other, and files that include each other, can grow exponentially. A
// file is looked for in all folders.
constexpr std::size_t kLongestValue = 1 << 20, kMostIncludes = 1000, kLongestText = std::size_t{1} << 28,
                      kMostFolders = 100;

const std::string& nameOf(const std::string& name) {
  return name;
}
const std::string& nameOf(const std::pair<const std::string, std::string>& definition) {
  return definition.first;
}

/// Up to ten of the names, shortened, in a container of names or definitions, and the number of others.
std::string listed(const auto& names) {
  constexpr std::size_t kMost = 10;
  std::vector<std::string> some;
  for (auto name = names.begin(); name != names.end() && some.size() < kMost; ++name)
    some.push_back(shortened(nameOf(*name)));
  const std::string text = fmt::format("{}", fmt::join(some, ", "));
  return names.size() > kMost ? fmt::format("{} and {} more", text, names.size() - kMost) : text;
}

bool isNameCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
}

/// Offset after the '>' of the tag that begins at `begin`.
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

/// The text between the tags of an element of a well-formed file, in a tree with comments and processing instructions:
/// then the last end tag before the next node, or else before the end of the parent, is that of the element.
TextRange contentOf(std::string_view text, pugi::xml_node element) {
  const std::size_t begin = endOfTag(text, static_cast<std::size_t>(SceneFile::location(element)));
  if (text[begin - 2] == '/') return {begin, begin};
  std::size_t limit = text.size();
  if (const pugi::xml_node next = element.next_sibling())
    limit = static_cast<std::size_t>(SceneFile::location(next));
  else if (const pugi::xml_node parent = element.parent(); parent.type() == pugi::node_element)
    limit = contentOf(text, parent).end;
  return {begin, text.rfind("</", limit - 1)};
}

/// The element with its tags.
TextRange rangeOf(std::string_view text, pugi::xml_node element) {
  const TextRange content = contentOf(text, element);
  const bool hasEndTag = text[content.begin - 2] != '/';
  return {static_cast<std::size_t>(SceneFile::location(element)),
          hasEndTag ? endOfTag(text, content.end) : content.end};
}

/// The first error in the XML; an empty message if there is none.
struct ParseFault {
  std::size_t offset = 0;
  std::string message;
};

constexpr unsigned int kWithComments = pugi::parse_default | pugi::parse_comments | pugi::parse_pi;

/// Parses the text. Returns the only <scene> at the top of the document; null if there is a fault.
pugi::xml_node sceneIn(pugi::xml_document& document, std::string_view text, unsigned int parseOptions,
                       ParseFault& fault) {
  const pugi::xml_parse_result result =
      document.load_buffer(text.data(), text.size(), parseOptions, pugi::encoding_utf8);
  // "Error parsing start element tag" and the like, from pugixml's table.
  if (!result) fault = {static_cast<std::size_t>(result.offset), fmt::format("broken XML: {}", result.description())};
  if (!result) return {};
  pugi::xml_node scene;
  for (const pugi::xml_node node : document.children()) {
    if (node.type() == pugi::node_comment || node.type() == pugi::node_pi) continue;
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

}  // namespace

SceneFile::SceneFile(const std::filesystem::path& path, const std::map<std::string, std::string>& definitions,
                     Findings& findings)
    : findings_(findings), search_(path.parent_path()), values_(definitions) {
  Expansion expansion;
  {
    pugi::xml_document document;
    const std::size_t file = addFile(path, 0);
    checkValues(definitions);
    const pugi::xml_node scene = parseAlone(file, document);
    expand(file, scene, {0, files_[file].text.size()}, expansion);
  }
  text_ = std::move(expansion.text);
  segments_ = std::move(expansion.segments);
  parse();
  search_.clear();  // the folders are in the order in which the files were opened, not in that of the elements
  paths_ = 0;
  readFolders(scene_, 0);
  substitute(scene_);
  indexIds(scene_);
  indexAliases();
}

/// A $ in the value would be taken for a $name that is not defined.
void SceneFile::checkValues(const std::map<std::string, std::string>& definitions) const {
  for (const auto& [name, value] : definitions)
    if (value.find('$') != std::string::npos)
      fail(std::ptrdiff_t{0}, fmt::format("-D defines ${} as \"{}\": the value of a definition must not contain $",
                                          shortened(name), shortened(value)));
}

void SceneFile::parse() {
  ParseFault fault;
  scene_ = sceneIn(document_, text_, pugi::parse_default, fault);
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

void SceneFile::fault(std::ptrdiff_t location, const std::string& message, const std::string& consequence) {
  findings_.fault(where(location), message, message, consequence);
}

/// The text of the scene begins at the location `start`.
void SceneFile::readDefaults(pugi::xml_node scene, std::ptrdiff_t start) {
  for (const pugi::xml_node node : scene.children("default")) {
    const pugi::xml_attribute name = node.attribute("name"), value = node.attribute("value");
    const std::ptrdiff_t at = start + location(node);
    if (!name || !value) {
      fault(at, "<default> needs a name and a value", "it is ignored");
      continue;
    }
    usedNames_.insert(name.value());
    if (!values_.contains(name.value())) values_.emplace(name.value(), substituted(value.value(), at));
  }
}

/// The text of the scene begins at the location `start`.
void SceneFile::readFolders(pugi::xml_node scene, std::ptrdiff_t start) {
  for (const pugi::xml_node node : scene.children("path")) {
    const std::ptrdiff_t at = start + location(node);
    if (++paths_ > kMostFolders) fail(at, fmt::format("more than {} <path>s", kMostFolders));
    const std::filesystem::path folder = resolve(substituted(node.attribute("value").value(), at), at);
    if (!node.attribute("value"))
      fault(at, "<path> needs a value", "it is ignored");
    else if (!search_.add(folder))
      fault(at, fmt::format("<path>: there is no folder {}", folder.string()), "it is ignored");
  }
}

std::size_t SceneFile::addFile(const std::filesystem::path& path, std::size_t parent) {
  File file{path, readXmlText(path), parent, {}};
  file.lines = indexLines(file.text);
  const std::size_t begin = files_.empty() ? 0 : segments_.back().begin + files_.back().text.size() + 1;
  segments_.push_back({begin, files_.size(), 0});
  files_.push_back(std::move(file));
  return files_.size() - 1;
}

/// The file of an <include> in the file `around`.
std::size_t SceneFile::addIncluded(pugi::xml_node include, std::size_t around) {
  const std::ptrdiff_t at = startOf(around) + location(include);
  const pugi::xml_attribute name = include.attribute("filename");
  if (!name) fail(at, "<include> needs a filename");
  if (files_.size() > kMostIncludes) fail(at, fmt::format("more than {} <include>s", kMostIncludes));
  const std::filesystem::path path = resolve(substituted(name.value(), at), at);
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) fail(at, fmt::format("<include>: no file {}", path.string()));
  for (std::size_t file = around;; file = files_[file].parent) {
    if (std::filesystem::equivalent(files_[file].path, path, error))
      fail(at, fmt::format("<include>: {} includes itself", path.string()));
    if (file == 0) break;
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) fail(at, fmt::format("<include>: {}: {}", path.string(), error.message()));
  if (files_[0].text.size() + included_ + size > kLongestText)
    fail(at, fmt::format("the file with all included files is longer than {} bytes", kLongestText));
  included_ += size;
  return addFile(path, around);
}

/// Parses a file before its <include>s are replaced, with its comments. Throws SceneError.
pugi::xml_node SceneFile::parseAlone(std::size_t file, pugi::xml_document& document) const {
  ParseFault fault;
  const pugi::xml_node scene = sceneIn(document, files_[file].text, kWithComments, fault);
  if (!scene) fail(startOf(file) + static_cast<std::ptrdiff_t>(fault.offset), fault.message);
  return scene;
}

/// Reads the definitions of a file, and appends this range of its text, with its <include>s replaced.
void SceneFile::expand(std::size_t file, pugi::xml_node scene, TextRange range, Expansion& result) {
  readDefaults(scene, startOf(file));
  readFolders(scene, startOf(file));
  for (const pugi::xml_node include : scene.children("include")) {
    const TextRange element = rangeOf(files_[file].text, include);
    append(file, {range.begin, element.begin}, result);
    range.begin = element.end;
    expandInclude(include, file, result);
  }
  append(file, range, result);
}

/// Appends the content of the file that is included in the file `around`. If it cannot be read, adds a fault instead.
void SceneFile::expandInclude(pugi::xml_node include, std::size_t around, Expansion& result) {
  throwIfCancelled();
  pugi::xml_document document;
  pugi::xml_node scene;
  std::size_t file = 0;
  try {
    file = addIncluded(include, around);
    scene = parseAlone(file, document);
  } catch (const SceneError& error) {
    for (const Fault& fault : error.faults())
      findings_.fault(fault.where, fault.message, fault.message, "the included file is left out");
    return;
  }
  expand(file, scene, contentOf(files_[file].text, scene), result);
}

void SceneFile::append(std::size_t file, TextRange range, Expansion& result) const {
  if (range.begin == range.end) return;
  result.segments.push_back({result.text.size(), file, range.begin});
  result.text.append(files_[file].text, range.begin, range.end - range.begin);
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
    if (std::strchr(attribute.value(), '$'))
      attribute.set_value(substituted(attribute.value(), location(node)).c_str());
  for (const pugi::xml_node child : node.children())
    if (child.type() == pugi::node_element) substitute(child);
}

std::string SceneFile::substituted(const std::string& text, std::ptrdiff_t location) {
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
    if (it == values_.end()) reportUndefined(name, location);
    result += it == values_.end() ? "$" + name : it->second;
    if (result.size() > kLongestValue)
      fail(location, fmt::format("with its $names replaced, a value is longer than {} characters", kLongestValue));
    usedNames_.insert(name);
    i = end;
  }
  substituted_ += result.size();
  if (substituted_ > kLongestText)
    fail(location, fmt::format("with all $names replaced, the values are longer than {} characters", kLongestText));
  return result;
}

void SceneFile::reportUndefined(const std::string& name, std::ptrdiff_t location) {
  findings_.fault(where(location), fmt::format("${} is not defined", name),
                  fmt::format("${} is not defined: neither by a <default> nor by -D{}", shortened(name),
                              values_.empty() ? "" : fmt::format("; defined are {}", listed(values_))),
                  "the element is left out");
}

void SceneFile::checkDefinitionsUsed(const std::map<std::string, std::string>& definitions,
                                     const SceneFile* other) const {
  const auto used = [](const SceneFile& file) { return file.usedNames_.empty() ? "none" : listed(file.usedNames_); };
  for (const auto& [name, value] : definitions) {
    if (uses(name) || (other && other->uses(name))) continue;
    if (!other)
      fail(scene_, fmt::format("-D defines ${}, which the scene does not use; it uses {}", name, used(*this)));
    fail(scene_, fmt::format("-D defines ${}, which neither file uses; {} uses {}, and {} uses {}", name,
                             files_[0].path.string(), used(*this), other->files_[0].path.string(), used(*other)));
  }
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
        fault(location(child),
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
      fault(location(node), "<alias> needs the attributes id and as", consequence);
    else if (!byId(id))
      fault(location(node), fmt::format("there is no element with the id \"{}\"", id), consequence);
    else if (!ids_.emplace(as, byId(id)).second)
      fault(location(node), fmt::format("the id \"{}\" is already used", as), consequence);
  }
}

std::filesystem::path SceneFile::resolve(const std::string& name, std::ptrdiff_t location) const {
  const FileSearch::Result& found = search_.find(name);
  if (!found.wanted.empty()) {
    const std::string message =
        fmt::format("{} does not exist: {} is used instead", found.wanted.string(), found.path.string());
    findings_.warn(where(location), message, message);
  }
  findings_.addFile(found.path);
  return found.path;
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
