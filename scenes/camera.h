#pragma once
// Converts a camera's field of view for a given image size.

#include "scenes/scene.h"

namespace lobe {

/// The full horizontal angle in degrees when camera.fov is measured along camera.fovAxis ("x", "y", "diagonal",
/// "smaller" or "larger" side) of an image of this size. Pixels are square.
float horizontalFov(const Camera& camera, int width, int height);

}  // namespace lobe
