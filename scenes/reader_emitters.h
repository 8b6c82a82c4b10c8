#pragma once
// Emitters of scene files that stand outside shapes.

#include "scenes/reader_textures.h"

namespace lobe {

/// Adds an emitter to the scene: a point-like one to its lights, a constant or envmap as its environment; without
/// geometry, only checks what can be checked without the image. Throws SceneError, also when the scene has an
/// environment already.
void readEmitter(ReadContext& context, TextureReader& textures, pugi::xml_node node);

}  // namespace lobe
