#include "runtime/render/gradients/gradient_integrator.h"

#include "runtime/render/gradients/gradient_path.h"
#include "runtime/render/integrators/path_integrator.h"

namespace lobe {

GradientSample PathGradients::sample(int x, int y, Sampler& rng, PathStatistics& statistics) const {
  const BsdfSampler sampler;
  const GradientContext<BsdfSampler> context{scene_, camera_, options_, sampler};
  return GradientPath(context, rng, statistics).trace(x, y);
}

GradientSample GuidedGradients::sample(int x, int y, Sampler& rng, PathStatistics& statistics) const {
  const GradientContext<GuidedSampler> context{scene_, camera_, options_, sampler_};
  return GradientPath(context, rng, statistics).trace(x, y);
}

RenderResult render(const RayCamera& camera, const GradientIntegrator& integrator, GradientFilm& film,
                    const RenderOptions& options, const AfterWave& afterWave, const RenderResult& before) {
  const AddSample addSample = [&](int x, int y, Sampler& rng, PathStatistics& statistics) {
    film.add(x, y, integrator.sample(x, y, rng, statistics));
  };
  return render(camera, addSample, film.pixels(), options, afterWave, before);
}

}  // namespace lobe
