#pragma once
// Emitters of scene files outside shapes.

#include "scenes/mitsuba/reader_daylight.h"
#include "scenes/mitsuba/reader_textures.h"

namespace lobe {

class EmitterReader {
 public:
  EmitterReader(ReadContext& context, TextureReader& textures)
      : context_(context), textures_(textures), daylight_(context) {}

  /// Adds a point, spot, projector or directional emitter to the scene's lights; a constant or envmap becomes its
  /// environment; skies and suns are added by finish(). Without geometry, checks only what can be checked without an
  /// image. Throws SceneError, also for a second environment.
  void add(pugi::xml_node node);
  /// Creates the environment from skies and suns.
  void finish() { daylight_.finish(); }

 private:
  void addDelta(pugi::xml_node node, const Parameters& parameters, const std::string& type);
  void addDistant(pugi::xml_node node, const Parameters& parameters, const std::string& type);

  ReadContext& context_;
  TextureReader& textures_;
  DaylightReader daylight_;
  bool environment_ = false;  // whether there was a constant or envmap
};

}  // namespace lobe
