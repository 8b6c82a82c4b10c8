#pragma once
// Renders of a small scene, repeated with different seeds, for z-tests between integrators. The variance of blocks of
// pixels is estimated from the repetitions, because a light path contributes to several pixels at once.

#include "runtime/render/integrators/bidirectional_integrator.h"
#include "runtime/render/integrators/bidirectional_paths.h"
#include "runtime/render/integrators/renderer.h"
#include "runtime/render/training/light_learning.h"
#include "tests/support/agreement.h"

namespace lobe::test {

/// Path tracing with light paths. Both guides may be wrong, to test that this is detected.
template <class CameraGuide = BsdfSampler, class LightGuide = BsdfSampler>
class PathWithLight : public BidirectionalIntegrator {
 public:
  PathWithLight(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                const LightTracing& tracing, CameraGuide cameraGuide = {}, LightGuide lightGuide = {})
      : scene_(scene),
        camera_(camera),
        options_(options),
        tracing_(tracing),
        cameraGuide_(cameraGuide),
        lightGuide_(lightGuide) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override {
    return radianceWithLightPaths(scene_, camera_, options_, cameraGuide_, lightGuide_, tracing_, ray, rng, lightRng,
                                  statistics, splats);
  }

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  LightTracing tracing_;
  CameraGuide cameraGuide_;
  LightGuide lightGuide_;
};

/// A scene that is ready to be rendered, with a learnt choice of lights.
struct Stage {
  explicit Stage(Scene s) : scene(std::move(s)), ready(scene), camera(scene.camera, scene.filter) {
    options.emitterVisibility = scene.emitterVisibility;
    ready.lights.use(learnLightCells(ready, camera, 1));
  }
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  PathIntegrator path() const { return {ready, options}; }
  BdptIntegrator bdpt() const { return {ready, camera, options}; }
  PathWithLight<> pathWithLight(double pathsPerPixel = 1) const {
    return {ready, camera, options, {pathsPerPixel, PhotonEmission(ready.lights)}};
  }
  /// radius: of merging, in world units, for all samples.
  VcmIntegrator vcm(float radius) const { return {ready, camera, options, {radius, 1}}; }

  Scene scene;
  RenderScene ready;
  RayCamera camera;
  PathOptions options;
};

struct Batches {
  int count;    ///< of independent images
  int samples;  ///< per pixel of each
  std::uint64_t seed;
};

inline constexpr int kBlockSize = 5;

/// Means over blocks of kBlockSize × kBlockSize pixels and all channels.
template <class AnyIntegrator>
std::vector<Block> renderBlocks(const RayCamera& camera, AnyIntegrator integrator, const Batches& batches) {
  std::vector<Block> sums;
  for (int i = 0; i < batches.count; ++i) {
    Film film(camera.width(), camera.height());
    RenderOptions options;
    options.seed = batches.seed + static_cast<std::uint64_t>(i);
    options.samples = batches.samples;
    render(camera, integrator, film, options);
    REQUIRE(film.dropped() == 0);
    const std::vector<Block> image = blocks(film, kBlockSize);
    sums.resize(image.size());
    for (std::size_t b = 0; b < image.size(); ++b) {
      sums[b].mean += image[b].mean;
      sums[b].variance += image[b].mean * image[b].mean;
    }
  }
  const double n = batches.count;
  for (Block& block : sums) {
    block.mean /= n;
    block.variance = std::max(0.0, block.variance / n - block.mean * block.mean) / (n - 1);
  }
  return sums;
}

template <class AnyIntegrator>
std::vector<Block> renderBlocks(const Stage& stage, AnyIntegrator integrator, const Batches& batches) {
  return renderBlocks(stage.camera, integrator, batches);
}

}  // namespace lobe::test
