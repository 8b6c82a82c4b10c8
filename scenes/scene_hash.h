#pragma once
// Hashes of everything in a scene that determines its light transport, or its picture.

#include <cstdint>

#include "scenes/scene.h"

namespace lobe {

/// Hash of everything that determines the light transport: shapes, instances, materials with their textures, and
/// emitters, in the order of the file; but not camera, film, names and maximum depth. It is the same in every run and
/// for any number of threads. Equivalent scenes that are described differently may have different hashes.
std::uint64_t lightHash(const Scene& scene);

/// Hash of the light transport together with camera, film, pixel filter, maximum depth and emitter visibility: equal
/// for scenes that produce the same picture.
std::uint64_t pictureHash(const Scene& scene);

}  // namespace lobe
