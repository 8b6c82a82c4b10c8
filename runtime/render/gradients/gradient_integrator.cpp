#include "runtime/render/gradients/gradient_integrator.h"

#include "runtime/render/gradients/gradient_bidirectional_path.h"
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

GradientSample BdptGradients::sample(int x, int y, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                                     GradientSplats splats) const {
  const BsdfSampler sampler;
  const GradientContext<BsdfSampler> context{scene_, camera_, options_, sampler};
  return GradientBidirectionalPath(context, sampler, rng, statistics).trace(x, y, lightRng, splats);
}

GradientSample GuidedBdptGradients::sample(int x, int y, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                                           GradientSplats splats) const {
  const GradientContext<GuidedSampler> context{scene_, camera_, options_, cameraGuide_};
  return GradientBidirectionalPath(context, lightGuide_, rng, statistics).trace(x, y, lightRng, splats);
}

RenderResult render(const RayCamera& camera, const GradientIntegrator& integrator, GradientFilm& film,
                    const RenderOptions& options, const AfterWave& afterWave, const RenderResult& before) {
  const AddSample addSample = [&](int x, int y, Sampler& rng, PathStatistics& statistics) {
    film.add(x, y, integrator.sample(x, y, rng, statistics));
  };
  return render(camera, addSample, film.pixels(), options, afterWave, before);
}

RenderResult render(const RayCamera& camera, const BidirectionalGradientIntegrator& integrator, GradientFilm& film,
                    const RenderOptions& options, const AfterWave& afterWave, const RenderResult& before) {
  std::vector<GradientSample> fromCamera(film.pixels().pixels().size());
  GradientLightImage fromLights(camera);
  const AddImageSample addSample = [&](const ImageSample& sample) {
    fromLights.clear(sample.tiles());
    const PathStatistics statistics =
        sample.forEachPixel([&](int x, int y, int tile, Sampler& rng, Sampler& lightRng, PathStatistics& counts) {
          fromCamera[static_cast<std::size_t>(y) * camera.width() + x] =
              integrator.sample(x, y, rng, lightRng, counts, fromLights.splats(tile));
        });
    fromLights.sum();
    for (int y = 0; y < camera.height(); ++y)
      for (int x = 0; x < camera.width(); ++x)
        film.add(x, y, fromCamera[static_cast<std::size_t>(y) * camera.width() + x] + fromLights.at(x, y));
    return statistics;
  };
  return render(camera, addSample, film.pixels(), options, afterWave, before);
}

}  // namespace lobe
