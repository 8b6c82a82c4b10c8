#pragma once
// The lobes that a scene needs caches of.

#include <vector>

#include "scenes/scene.h"

namespace lobe {

/// The lobes of the scene's materials in the order of the materials; lobes with equal keys are listed once.
std::vector<LobeUse> collectLobes(const Scene& scene);

}  // namespace lobe
