#pragma once
// Emitters of scene files that stand outside shapes.

#include "scenes/mitsuba/reader_daylight.h"
#include "scenes/mitsuba/reader_textures.h"

namespace lobe {

class EmitterReader {
 public:
  EmitterReader(ReadContext& context, TextureReader& textures)
      : context_(context), textures_(textures), daylight_(context) {}

  /// A point-like emitter goes to the scene's lights, a constant or envmap becomes its environment; skies and suns are
  /// left for finish. Without geometry, only checks what can be checked without an image. Throws SceneError, also for
  /// an environment besides another.
  void add(pugi::xml_node node);
  /// Makes the environment of skies and suns.
  void finish() { daylight_.finish(); }

 private:
  void addDelta(pugi::xml_node node, const Parameters& parameters, const std::string& type);
  void addDistant(pugi::xml_node node, const Parameters& parameters, const std::string& type);

  ReadContext& context_;
  TextureReader& textures_;
  DaylightReader daylight_;
  bool environment_ = false;  // a constant or envmap was there
};

}  // namespace lobe
