#pragma once
// What all parts of the reader share: the file, the options, and where findings go.

#include <functional>
#include <string>
#include <string_view>

#include "scenes/mitsuba/reader.h"
#include "scenes/mitsuba/scene_file.h"

namespace lobe {

class ReadContext {
 public:
  ReadContext(const SceneFile& sceneFile, const ReadOptions& readOptions, Scene& result, Findings& found)
      : file(sceneFile), options(readOptions), scene(result), findings(found) {}

  /// Something wrong or not known: reading goes on, so that all faults are found in one run. The message says what is
  /// known; consequence says what lenient reading makes of it ("a grey one is used").
  void unsupported(pugi::xml_node node, const std::string& kind, std::string_view message,
                   std::string_view consequence) {
    unsupported(SceneFile::location(node), kind, message, consequence);
  }
  void unsupported(std::ptrdiff_t location, const std::string& kind, std::string_view message,
                   std::string_view consequence);

  /// Something that is read, but not as it stands there: a warning, the first time for each kind. The message says what
  /// was found and what is done instead.
  void warn(std::ptrdiff_t location, const std::string& kind, std::string_view message);

  /// What was read but replaced by something of ours; equal notes are kept once.
  void note(std::string text) { findings.note(std::move(text)); }

  /// Runs read. A SceneError that it throws becomes a fault with this consequence. Returns whether there was none.
  bool attempt(const std::string& consequence, const std::function<void()>& read);

  const SceneFile& file;
  const ReadOptions& options;
  Scene& scene;
  Findings& findings;
};

/// While it lives, an element that may have others like it inside, by references too, is being read. Throws SceneError
/// when they are nested too deeply to be read by recursion.
class Nesting {
 public:
  Nesting(const ReadContext& context, pugi::xml_node node, int& depth);
  ~Nesting() { --depth_; }
  Nesting(const Nesting&) = delete;
  Nesting& operator=(const Nesting&) = delete;

 private:
  int& depth_;
};

/// The type attribute; fails when there is none.
std::string typeOf(const ReadContext& context, pugi::xml_node node);

/// "bsdf \"plastic\"", or "scene" for an element without type.
std::string describe(pugi::xml_node node);

/// "this <bsdf>", or "this text".
std::string nameOf(pugi::xml_node node);

/// Name of the element, in today's spelling: camera is sensor, luminaire emitter (Mitsuba 0.4), lookAt lookat; a colour
/// with a type and no value, such as <spectrum type="d65">, is a texture, as Mitsuba goes by the type alone.
std::string_view elementName(pugi::xml_node node);

/// Fails when the node is text, at its first word: scene files keep everything in attributes.
void rejectText(const ReadContext& context, pugi::xml_node node);

/// A fault: participating media are not rendered.
void rejectMedium(ReadContext& context, pugi::xml_node node);

/// The target of a <ref>; fails when there is no such id.
pugi::xml_node resolveReference(const ReadContext& context, pugi::xml_node ref);

}  // namespace lobe
