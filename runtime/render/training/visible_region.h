#pragma once
// The part of a scene in which the paths of a camera have their vertices. Lengths that follow the size of the scene
// follow this region: the bounding box of a room on a ground plane of kilometres, or within a sphere with the picture
// of a sky, says nothing about the room.

#include <cstdint>
#include <limits>

#include "runtime/render/film/camera.h"
#include "runtime/render/lights/render_scene.h"

namespace lobe {

/// A box around nearly all vertices, enlarged by half of their extent, but not beyond the bounding box of the scene;
/// the latter if there are few vertices. Depends on the seed, not on the number of threads. maxDepth:
/// PathOptions::maxDepth of the picture.
Eigen::AlignedBox3f visibleRegion(const RenderScene& scene, const RayCamera& camera, std::uint64_t seed,
                                  int maxDepth = std::numeric_limits<int>::max());

}  // namespace lobe
