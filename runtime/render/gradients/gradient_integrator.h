#pragma once
// Gradient-domain path tracing with any sampler of the path loop: BSDF sampling, guided or product; and gradient-domain
// bidirectional path tracing with the same.

#include "runtime/render/film/camera.h"
#include "runtime/render/gradients/gradient_film.h"
#include "runtime/render/gradients/gradient_light_image.h"
#include "runtime/render/integrators/guided_integrator.h"
#include "runtime/render/integrators/path_integrator.h"
#include "runtime/render/integrators/renderer.h"

namespace lobe {

class GradientIntegrator {
 public:
  virtual ~GradientIntegrator() = default;
  /// A sample of the pixel in column x and row y, and of its differences from its neighbours. The expected radiance is
  /// that of the integrator with the same sampler. Called concurrently from many threads.
  virtual GradientSample sample(int x, int y, Sampler& rng, PathStatistics& statistics) const = 0;
};

/// Gradient-domain path tracing. The guide (path_loop.h) samples the directions.
template <class Guide>
class PathGradientsOf : public GradientIntegrator {
 public:
  /// Scene and camera must outlive it. Of the options, counts is not used: Russian roulette is by throughput.
  PathGradientsOf(const RenderScene& scene, const RayCamera& camera, const PathOptions& options, Guide guide = {})
      : scene_(scene), camera_(camera), options_(options), guide_(guide) {}
  GradientSample sample(int x, int y, Sampler& rng, PathStatistics& statistics) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  Guide guide_;
};

using PathGradients = PathGradientsOf<BsdfSampler>;
/// The guide must outlive it.
using GuidedGradients = PathGradientsOf<const GuidedSampler&>;

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

/// Gradient-domain bidirectional path tracing. The guides sample the directions of camera paths and of light paths.
template <class CameraGuide, class LightGuide>
class BdptGradientsOf : public BidirectionalGradientIntegrator {
 public:
  /// As for Bdpt.
  BdptGradientsOf(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                  CameraGuide cameraGuide = {}, LightGuide lightGuide = {})
      : scene_(scene), camera_(camera), options_(options), cameraGuide_(cameraGuide), lightGuide_(lightGuide) {}
  GradientSample sample(int x, int y, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                        GradientSplats splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  CameraGuide cameraGuide_;
  LightGuide lightGuide_;
};

using BdptGradients = BdptGradientsOf<BsdfSampler, BsdfSampler>;
/// As for GuidedBdptIntegrator.
using GuidedBdptGradients = BdptGradientsOf<const GuidedSampler&, const GuidedSampler&>;

/// As render in renderer.h.
RenderResult render(const RayCamera& camera, const GradientIntegrator& integrator, GradientFilm& film,
                    const RenderOptions& options, const AfterWave& afterWave = {}, const RenderResult& before = {});
RenderResult render(const RayCamera& camera, const BidirectionalGradientIntegrator& integrator, GradientFilm& film,
                    const RenderOptions& options, const AfterWave& afterWave = {}, const RenderResult& before = {});

}  // namespace lobe
