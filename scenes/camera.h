#pragma once
// The size of pictures, and a camera's field of view for a given size.

#include <cstdint>

#include "scenes/scene.h"

namespace lobe {

/// The most pixels of a picture, and of a side of it; larger sizes are assumed to be typing errors.
inline constexpr std::int64_t kMaxPicturePixels = std::int64_t{1} << 28;
inline constexpr int kMaxPictureSide = 1 << 16;

/// The full horizontal angle in degrees when camera.fov is measured along camera.fovAxis ("x", "y", "diagonal",
/// "smaller" or "larger" side) of an image of this size. Pixels are square.
float horizontalFov(const Camera& camera, int width, int height);

}  // namespace lobe
