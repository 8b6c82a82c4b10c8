#include "runtime/render/integrators/path_integrator.h"

namespace lobe {

Rgb PathIntegrator::radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const {
  const BsdfSampler sampler;
  return PathLoop(scene_, options_, sampler).radiance(ray, rng, statistics);
}

}  // namespace lobe
