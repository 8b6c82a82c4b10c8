#pragma once
// Tells scenes apart by their light, and by the picture they make.

#include <cstdint>

#include "scenes/scene.h"

namespace lobe {

/// Equal for scenes in which the same light travels, on every run and any number of threads: of shapes, instances,
/// materials with their textures, and emitters in the order of the file; not of camera, film, names and depth. Scenes
/// described in different words may differ.
std::uint64_t lightHash(const Scene& scene);

/// The same of light, camera, film and its filter: of scenes that make the same picture.
std::uint64_t pictureHash(const Scene& scene);

}  // namespace lobe
