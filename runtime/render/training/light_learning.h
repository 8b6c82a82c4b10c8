#pragma once
// Learns the choice of lights for next-event estimation from a few camera paths before rendering, for all integrators.

#include <cstdint>
#include <limits>

#include "runtime/render/film/camera.h"
#include "runtime/render/lights/render_scene.h"

namespace lobe {

/// The cells of scene.lights for this camera (Lights::use). Depends on the seed and the size of the picture, not on the
/// number of threads. Empty if there is nothing to choose between. maxDepth: PathOptions::maxDepth of the picture.
LightCells learnLightCells(const RenderScene& scene, const RayCamera& camera, std::uint64_t seed,
                           int maxDepth = std::numeric_limits<int>::max());

}  // namespace lobe
