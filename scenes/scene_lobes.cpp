#include "scenes/scene_lobes.h"

#include <string>
#include <unordered_map>

namespace lobe {

std::vector<LobeUse> collectLobes(const Scene& scene) {
  std::vector<LobeUse> uses;
  std::unordered_map<std::string, std::size_t> known;
  for (const Material& material : scene.materials) {
    for (const LobePtr& lobe : material.bsdf->lobes()) {
      const auto [entry, isNew] = known.try_emplace(lobe->key(), uses.size());
      if (isNew) uses.push_back({lobe, {}});
      std::vector<std::string>& names = uses[entry->second].materials;
      // The two sides of a two-sided material may share a lobe.
      if (names.empty() || names.back() != material.name) names.push_back(material.name);
    }
  }
  return uses;
}

}  // namespace lobe
