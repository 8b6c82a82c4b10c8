#pragma once
// A scene file as a tree of elements with locations: included files are inserted, the text is parsed, $names are
// substituted, and ids are indexed.
//
// The parser sees all files as one text. A location is an offset in that text; where() converts it to a place in a
// file.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <pugixml.hpp>

#include "scenes/mitsuba/file_search.h"
#include "scenes/mitsuba/file_text.h"
#include "scenes/mitsuba/findings.h"

namespace lobe {

/// The characters [begin, end) of a text.
struct TextRange {
  std::size_t begin, end;
};

class SceneFile {
 public:
  /// Reads and parses the file, replaces every <include> by the content of the <scene> in that file, and replaces every
  /// $name by its definition or, without one, by the first <default> of this name. Adds faults to findings, which must
  /// outlive this object: an undefined $name, a duplicate id, a file that cannot be included. Throws SceneError when
  /// nothing can be read (no such file, malformed XML, elements nested too deeply), or if a definition contains a $.
  SceneFile(const std::filesystem::path& path, const std::map<std::string, std::string>& definitions,
            Findings& findings);

  pugi::xml_node scene() const { return scene_; }

  /// Whether the file has $name, or a <default> for it.
  bool uses(const std::string& name) const { return usedNames_.contains(name); }
  /// Throws SceneError for a definition that neither this file nor the other one uses; other may be null.
  void checkDefinitionsUsed(const std::map<std::string, std::string>& definitions, const SceneFile* other) const;

  /// Whether the scene's version says that it is written for Mitsuba 2 or 3, which have some different defaults. A
  /// scene without a version is an older one.
  bool isOfToday() const { return majorVersion() >= 2; }
  /// The number before the first dot of the scene's version; 0 without one.
  int majorVersion() const;

  /// Whether an attribute of the element still contains a $name, which has been reported as a fault already.
  static bool hasUndefinedName(pugi::xml_node node);

  /// The element with this id, or with the one that the id is an <alias> of; null when there is none.
  pugi::xml_node byId(const std::string& id) const;

  /// Path of a file that the scene names at that location: in one of the folders given by <path> (the last one first),
  /// else relative to the scene's own folder, also for names in included files. If it does not exist, but exactly one
  /// file differs from it only in case or in '\\' for '/', that file is used with a warning.
  std::filesystem::path resolve(const std::string& name, std::ptrdiff_t location) const;

  /// "FILE:LINE:COLUMN" of the element's '<'; columns count characters from one.
  std::string where(pugi::xml_node node) const { return where(location(node)); }
  std::string where(std::ptrdiff_t location) const;
  static std::ptrdiff_t location(pugi::xml_node node);

  /// Throws SceneError at that location.
  [[noreturn]] void fail(pugi::xml_node node, std::string_view message) const { fail(location(node), message); }
  [[noreturn]] void fail(std::ptrdiff_t location, std::string_view message) const;

 private:
  struct File {
    std::filesystem::path path;
    std::string text;
    std::size_t parent;  // the file that includes it; the first file is its own parent
    LineIndex lines;     // of the text
  };
  /// The text from begin to the next segment comes from a file, starting at offset.
  struct Segment {
    std::size_t begin, file, offset;
  };

  /// The text of all files, as far as their <include>s have been replaced.
  struct Expansion {
    std::string text;
    std::vector<Segment> segments;
  };

  void fault(std::ptrdiff_t location, const std::string& message, const std::string& consequence);
  void checkValues(const std::map<std::string, std::string>& definitions) const;
  void parse();
  void checkDepth() const;
  void readDefaults(pugi::xml_node scene, std::ptrdiff_t start);
  void readFolders(pugi::xml_node scene, std::ptrdiff_t start);
  std::size_t addFile(const std::filesystem::path& path, std::size_t parent);
  std::size_t addIncluded(pugi::xml_node include, std::size_t around);
  pugi::xml_node parseAlone(std::size_t file, pugi::xml_document& document) const;
  void expand(std::size_t file, pugi::xml_node scene, TextRange range, Expansion& result);
  void expandInclude(pugi::xml_node include, std::size_t around, Expansion& result);
  void append(std::size_t file, TextRange range, Expansion& result) const;
  std::ptrdiff_t startOf(std::size_t file) const { return static_cast<std::ptrdiff_t>(segments_[file].begin); }
  const Segment& segmentAt(std::size_t offset) const;
  void substitute(pugi::xml_node node);
  std::string substituted(const std::string& text, std::ptrdiff_t location);
  void reportUndefined(const std::string& name, std::ptrdiff_t location);
  void indexIds(pugi::xml_node node);
  void indexAliases();

  Findings& findings_;
  std::vector<File> files_;
  std::string text_;
  std::vector<Segment> segments_;  // in order; the first begins at 0. While files are read, each is one segment
  mutable FileSearch search_;      // it remembers what it has found
  std::size_t paths_ = 0;          // <path> elements that have been read
  pugi::xml_document document_;
  pugi::xml_node scene_;
  std::map<std::string, std::string> values_;
  std::set<std::string> usedNames_;
  std::size_t substituted_ = 0;  // characters of all values with $names
  std::uintmax_t included_ = 0;  // bytes of all included files, each as often as it is included
  std::map<std::string, pugi::xml_node> ids_;
};

}  // namespace lobe
