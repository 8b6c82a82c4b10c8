#include "runtime/render/gradients/gradient_integrator.h"

#include "runtime/render/gradients/gradient_bidirectional_path.h"
#include "runtime/render/gradients/gradient_path.h"

namespace lobe {

template <class Guide>
GradientSample PathGradientsOf<Guide>::sample(int x, int y, Sampler& rng, PathStatistics& statistics) const {
  return GradientPath(GradientContext{scene_, camera_, options_, guide_}, rng, statistics).trace(x, y);
}

template class PathGradientsOf<BsdfSampler>;
template class PathGradientsOf<const GuidedSampler&>;

template <class CameraGuide, class LightGuide>
GradientSample BdptGradientsOf<CameraGuide, LightGuide>::sample(int x, int y, Sampler& rng, Sampler& lightRng,
                                                                PathStatistics& statistics,
                                                                GradientSplats splats) const {
  return GradientBidirectionalPath(GradientContext{scene_, camera_, options_, cameraGuide_}, lightGuide_, rng,
                                   statistics)
      .trace(x, y, lightRng, splats);
}

template class BdptGradientsOf<BsdfSampler, BsdfSampler>;
template class BdptGradientsOf<const GuidedSampler&, const GuidedSampler&>;

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
