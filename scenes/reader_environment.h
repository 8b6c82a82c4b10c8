#pragma once
// Emitters of scene files that stand outside shapes.

#include "scenes/reader_textures.h"

namespace lobe {

/// Sets the scene's environment from a constant or envmap emitter; without geometry, only checks what can be checked
/// without the image. Throws SceneError, also when the scene has an environment already.
void readEnvironment(ReadContext& context, TextureReader& textures, pugi::xml_node node);

}  // namespace lobe
