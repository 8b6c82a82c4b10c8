#include "runtime/render/integrators/bidirectional_integrator.h"

#include <cmath>

#include "runtime/render/integrators/bidirectional_paths.h"

namespace lobe {

template <class CameraGuide, class LightGuide>
Rgb Bdpt<CameraGuide, LightGuide>::radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                                            std::vector<Splat>* splats) const {
  return BidirectionalPaths(scene_, camera_, options_, cameraGuide_, lightGuide_)
      .radiance(ray, rng, lightRng, statistics, splats);
}

template class Bdpt<BsdfSampler, BsdfSampler>;
template class Bdpt<const GuidedSampler&, const GuidedSampler&>;

Rgb GuidedLightIntegrator::radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                                    std::vector<Splat>* splats) const {
  return radianceWithLightPaths(scene_, camera_, options_, guide_, BsdfSampler(), tracing_, ray, rng, lightRng,
                                statistics, splats);
}

float MergeRadius::at(int sample) const {
  return first * std::pow(static_cast<float>(sample) + 1.0f, 0.5f * (alpha - 1.0f));
}

void VcmIntegrator::storeLightPath(Sampler& lightRng, PathStatistics& statistics, std::vector<Photon>& photons) const {
  const BsdfSampler sampler;
  BidirectionalPaths(scene_, camera_, options_, sampler, sampler).storePhotons(lightRng, statistics, current_, photons);
}

Rgb VcmIntegrator::radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                            std::vector<Splat>* splats) const {
  const BsdfSampler sampler;
  BidirectionalPaths paths(scene_, camera_, options_, sampler, sampler);
  paths.mergeWith(*grid_);
  return paths.radiance(ray, rng, lightRng, statistics, splats);
}

}  // namespace lobe
