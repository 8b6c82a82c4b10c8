#pragma once
// Collects the lobes of a scene, for which caches are fitted.

#include <vector>

#include "scenes/scene.h"

namespace lobe {

/// The lobes of the scene's materials in the order of the materials; lobes with equal keys are listed once.
std::vector<LobeUse> collectLobes(const Scene& scene);

}  // namespace lobe
