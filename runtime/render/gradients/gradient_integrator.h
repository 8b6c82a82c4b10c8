#pragma once
// Gradient-domain path tracing with any sampler of the path loop: BSDF sampling, guided or product; and gradient-domain
// bidirectional path tracing with the same.

#include "runtime/render/film/camera.h"
#include "runtime/render/gradients/gradient_film.h"
#include "runtime/render/gradients/gradient_light_image.h"
#include "runtime/render/integrators/guided_integrator.h"
#include "runtime/render/integrators/renderer.h"

namespace lobe {

class GradientIntegrator {
 public:
  virtual ~GradientIntegrator() = default;
  /// A sample of the pixel in column x and row y, and of its differences from its neighbours. The expected radiance is
  /// that of the integrator with the same sampler. Called concurrently from many threads.
  virtual GradientSample sample(int x, int y, Sampler& rng, PathStatistics& statistics) const = 0;
};

/// Scene and camera must outlive both classes. Of the options, counts is not used: Russian roulette is by throughput.
class PathGradients : public GradientIntegrator {
 public:
  PathGradients(const RenderScene& scene, const RayCamera& camera, const PathOptions& options)
      : scene_(scene), camera_(camera), options_(options) {}
  GradientSample sample(int x, int y, Sampler& rng, PathStatistics& statistics) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
};

class GuidedGradients : public GradientIntegrator {
 public:
  /// The sampler must outlive it.
  GuidedGradients(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                  const GuidedSampler& sampler)
      : scene_(scene), camera_(camera), options_(options), sampler_(sampler) {}
  GradientSample sample(int x, int y, Sampler& rng, PathStatistics& statistics) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  const GuidedSampler& sampler_;
};

/// Gradient-domain rendering with light paths, which contribute to any pixel.
class BidirectionalGradientIntegrator {
 public:
  virtual ~BidirectionalGradientIntegrator() = default;
  /// A sample of the pixel in column x and row y with one light path, which lightRng determines. The samples of all
  /// pixels, with the splats added to them, have the expected image of the integrator without gradients. Called
  /// concurrently from many threads.
  virtual GradientSample sample(int x, int y, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                                GradientSplats splats) const = 0;
};

/// Scene and camera must outlive both classes. Of the options, counts is not used.
class BdptGradients : public BidirectionalGradientIntegrator {
 public:
  BdptGradients(const RenderScene& scene, const RayCamera& camera, const PathOptions& options)
      : scene_(scene), camera_(camera), options_(options) {}
  GradientSample sample(int x, int y, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                        GradientSplats splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
};

class GuidedBdptGradients : public BidirectionalGradientIntegrator {
 public:
  /// camera and light: as for GuidedBdptIntegrator.
  GuidedBdptGradients(const RenderScene& scene, const RayCamera& sensor, const PathOptions& options,
                      const GuidedSampler& camera, const GuidedSampler& light)
      : scene_(scene), camera_(sensor), options_(options), cameraGuide_(camera), lightGuide_(light) {}
  GradientSample sample(int x, int y, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                        GradientSplats splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  const GuidedSampler& cameraGuide_;
  const GuidedSampler& lightGuide_;
};

/// As render in renderer.h.
RenderResult render(const RayCamera& camera, const GradientIntegrator& integrator, GradientFilm& film,
                    const RenderOptions& options, const AfterWave& afterWave = {}, const RenderResult& before = {});
RenderResult render(const RayCamera& camera, const BidirectionalGradientIntegrator& integrator, GradientFilm& film,
                    const RenderOptions& options, const AfterWave& afterWave = {}, const RenderResult& before = {});

}  // namespace lobe
