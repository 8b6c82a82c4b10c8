#pragma once
// State shared by all parts of the reader: the file, the options, the resulting scene and the findings.

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "runtime/core/vec.h"
#include "scenes/mitsuba/reader.h"
#include "scenes/mitsuba/scene_file.h"

namespace lobe {

/// The colours of the spectrum in a file.
struct SpectrumFile {
  Rgb equalEnergy = Rgb::Zero(), d65 = Rgb::Zero();  ///< by how the spectrum is weighted (see Illuminant)
  std::string fault = {};                            ///< why it cannot be read; otherwise empty
};

class ReadContext {
 public:
  ReadContext(const SceneFile& sceneFile, const ReadOptions& readOptions, Scene& result, Findings& found)
      : file(sceneFile), options(readOptions), scene(result), findings(found) {}

  /// Reports something wrong or unknown as a fault. Reading continues, so that all faults are found in one run. The
  /// message says what is known; consequence says what lenient reading does instead ("grey is used").
  void unsupported(pugi::xml_node node, const std::string& kind, std::string_view message,
                   std::string_view consequence) {
    unsupported(SceneFile::location(node), kind, message, consequence);
  }
  void unsupported(std::ptrdiff_t location, const std::string& kind, std::string_view message,
                   std::string_view consequence);

  /// Reports something that is not read as written as a warning, once for each kind. The message says what was found
  /// and what is done instead.
  void warn(std::ptrdiff_t location, const std::string& kind, std::string_view message);

  /// Reports something that is ignored or replaced; equal notes are kept once.
  void note(std::string text) { findings.note(std::move(text)); }

  /// Runs read. A SceneError that it throws becomes a fault with this consequence. Returns whether there was no fault.
  bool attempt(const std::string& consequence, const std::function<void()>& read);

  const SceneFile& file;
  const ReadOptions& options;
  Scene& scene;
  Findings& findings;
  std::map<std::filesystem::path, SpectrumFile> spectra;  ///< those that have been read
};

/// Scope in which an element is read that may contain elements of the same kind, also by reference. Throws SceneError
/// when they are nested too deeply for recursion.
class Nesting {
 public:
  Nesting(const ReadContext& context, pugi::xml_node node, int& depth);
  ~Nesting() { --depth_; }
  Nesting(const Nesting&) = delete;
  Nesting& operator=(const Nesting&) = delete;

 private:
  int& depth_;
};

/// The type attribute. Throws SceneError when there is none.
std::string typeOf(const ReadContext& context, pugi::xml_node node);

/// "bsdf \"plastic\"", or "scene" for an element without type; long names are shortened.
std::string describe(pugi::xml_node node);

/// "this <bsdf>", or "this text".
std::string nameOf(pugi::xml_node node);

/// Name of the element in the current spelling: sensor for camera, emitter for luminaire (Mitsuba 0.4), lookat for
/// lookAt, and texture for a colour with a type and no value, such as <spectrum type="d65">, because Mitsuba identifies
/// elements by their type.
std::string_view elementName(pugi::xml_node node);

/// Throws SceneError at the first word when the node is text: in scene files all values are attributes.
void rejectText(const ReadContext& context, pugi::xml_node node);

/// Reports a fault: participating media are not supported.
void rejectMedium(ReadContext& context, pugi::xml_node node);

/// The target of a <ref>. Throws SceneError when there is no such id.
pugi::xml_node resolveReference(const ReadContext& context, pugi::xml_node ref);

}  // namespace lobe
