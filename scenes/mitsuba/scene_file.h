#pragma once
// A scene file as a tree of elements with places: included files put in, parsed, $names substituted, ids indexed.
//
// All files are one text to the parser. A location is an offset in that text; where() knows the file it came from.

#include <cstddef>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <pugixml.hpp>

#include "scenes/mitsuba/findings.h"

namespace lobe {

/// Of characters in a text: from begin to before end.
struct TextRange {
  std::size_t begin, end;
};

class SceneFile {
 public:
  /// Reads and parses the file, puts what is in the <scene> of other files where it says <include>, and replaces every
  /// $name by the definition's value, else by that of the first <default> of this name. Faults go to findings, which
  /// must outlive it: an undefined $name, an id given twice, a file that cannot be included. Throws SceneError where
  /// nothing can be read: no such file, broken XML, elements nested too deeply; and for a definition that nothing uses.
  SceneFile(const std::filesystem::path& path, const std::map<std::string, std::string>& definitions,
            Findings& findings);

  pugi::xml_node scene() const { return scene_; }

  /// Written for Mitsuba 3 (or 2), by the scene's version; some defaults differ. Without a version it is an older one.
  bool isOfToday() const { return majorVersion() >= 2; }
  /// The number before the first dot of the scene's version; 0 without one.
  int majorVersion() const;

  /// Whether an attribute of the element still has a $name, which is a fault that has been found already.
  static bool hasUndefinedName(pugi::xml_node node);

  /// The element with this id, or with the one that the id is an <alias> of; null when there is none.
  pugi::xml_node byId(const std::string& id) const;

  /// A file that the scene names at that place: in a folder that a <path> gives, the latest first, or else relative to
  /// the scene's own folder, wherever included files are. Where there is none, but exactly one whose name differs by
  /// case or by '\\' for '/' only, it is that one, with a warning.
  std::filesystem::path resolve(const std::string& name, std::ptrdiff_t location) const;

  /// "FILE:LINE:COLUMN" of the element's '<'; columns count characters from one.
  std::string where(pugi::xml_node node) const { return where(location(node)); }
  std::string where(std::ptrdiff_t location) const;
  static std::ptrdiff_t location(pugi::xml_node node);

  /// Throws SceneError at that place.
  [[noreturn]] void fail(pugi::xml_node node, std::string_view message) const { fail(location(node), message); }
  [[noreturn]] void fail(std::ptrdiff_t location, std::string_view message) const;

 private:
  struct File {
    std::filesystem::path path;
    std::string text;
    std::size_t parent;              // the file that includes it; of the first, itself
    std::vector<std::size_t> lines;  // where they begin in the text
  };
  /// From begin on, to where the next segment begins, the text is that of a file from offset on.
  struct Segment {
    std::size_t begin, file, offset;
  };

  struct Part {
    std::size_t file;
    TextRange range;
  };

  void fault(pugi::xml_node node, const std::string& message, const std::string& consequence);
  void parse();
  void checkDepth() const;
  void readDefaults();
  void readFolders();
  bool expandInclude();
  std::size_t addFile(pugi::xml_node include);
  TextRange bodyOf(std::size_t file) const;
  void splice(std::size_t begin, std::size_t end, const Part& part);
  const Segment& segmentAt(std::size_t offset) const;
  void substitute(pugi::xml_node node);
  std::string substituted(const std::string& text, pugi::xml_node node);
  void checkDefinitionsUsed(const std::map<std::string, std::string>& definitions) const;
  std::vector<std::string> names() const;  // of all values
  void indexIds(pugi::xml_node node);
  void indexAliases();

  Findings& findings_;
  std::vector<File> files_;
  std::string text_;
  std::vector<Segment> segments_;  // in order, the first at 0
  std::vector<std::filesystem::path> folders_;
  pugi::xml_document document_;
  pugi::xml_node scene_;
  std::map<std::string, std::string> values_;
  std::set<std::string> usedNames_;
  std::map<std::string, pugi::xml_node> ids_;
};

}  // namespace lobe
