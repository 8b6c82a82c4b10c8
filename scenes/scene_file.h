#pragma once
// A scene file as a tree of elements with places: parsed, $names substituted, ids indexed.

#include <cstddef>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <pugixml.hpp>

namespace lobe {

class SceneFile {
 public:
  /// Reads and parses the file and replaces every $name by the definition's value, else by that of the first <default>
  /// of this name. Throws SceneError: no such file, broken XML, undefined $name, a definition that nothing uses, an id
  /// given twice.
  SceneFile(const std::filesystem::path& path, const std::map<std::string, std::string>& definitions);

  pugi::xml_node scene() const { return scene_; }

  /// Written for Mitsuba 3 (or 2), by the scene's version; some defaults differ. Without a version it is an older one.
  bool isOfToday() const;

  /// The element with this id; null when there is none.
  pugi::xml_node byId(const std::string& id) const;

  /// A file the scene names: relative to the scene's folder.
  std::filesystem::path resolve(const std::string& name) const { return path_.parent_path() / name; }

  /// "FILE:LINE:COLUMN" of the element's '<'; columns count characters from one.
  std::string where(pugi::xml_node node) const { return where(location(node)); }
  std::string where(std::ptrdiff_t location) const;
  static std::ptrdiff_t location(pugi::xml_node node);

  /// Throws SceneError at that place.
  [[noreturn]] void fail(pugi::xml_node node, std::string_view message) const { fail(location(node), message); }
  [[noreturn]] void fail(std::ptrdiff_t location, std::string_view message) const;

 private:
  void parse();
  void substituteAll();
  void substitute(pugi::xml_node node);
  std::string substituted(const std::string& text, pugi::xml_node node);
  void checkDefinitionsUsed(const std::map<std::string, std::string>& definitions) const;
  std::vector<std::string> names() const;  // of all values
  void indexIds(pugi::xml_node node);

  std::filesystem::path path_;
  std::string text_;
  pugi::xml_document document_;
  pugi::xml_node scene_;
  std::map<std::string, std::string> values_;
  std::set<std::string> usedNames_;
  std::map<std::string, pugi::xml_node> ids_;
};

}  // namespace lobe
