#pragma once
// Bidirectional path tracing (bidirectional_paths.h) with BSDF sampling, or guided in both directions, and vertex
// connection and merging.

#include "runtime/render/integrators/guided_integrator.h"
#include "runtime/render/integrators/path_integrator.h"

namespace lobe {

/// Bidirectional path tracing. The guides (path_loop.h) sample the directions of camera paths and of light paths.
template <class CameraGuide, class LightGuide>
class Bdpt : public BidirectionalIntegrator {
 public:
  /// Scene and camera must outlive it. Of the options, counts is not used: Russian roulette is by throughput.
  Bdpt(const RenderScene& scene, const RayCamera& camera, const PathOptions& options, CameraGuide cameraGuide = {},
       LightGuide lightGuide = {})
      : scene_(scene), camera_(camera), options_(options), cameraGuide_(cameraGuide), lightGuide_(lightGuide) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  CameraGuide cameraGuide_;
  LightGuide lightGuide_;
};

using BdptIntegrator = Bdpt<BsdfSampler, BsdfSampler>;
/// Light paths are guided by the importance that arrives from the camera. The guides must outlive it.
using GuidedBdptIntegrator = Bdpt<const GuidedSampler&, const GuidedSampler&>;

/// Guided path tracing whose camera paths are combined with light paths (light_tracing.h).
class GuidedLightIntegrator : public BidirectionalIntegrator {
 public:
  /// Scene, camera and guide must outlive it, and what they refer to. Light paths are sampled by the BSDF.
  GuidedLightIntegrator(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                        const GuidedSampler& guide, const LightTracing& tracing)
      : scene_(scene), camera_(camera), options_(options), guide_(guide), tracing_(tracing) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  const GuidedSampler& guide_;
  LightTracing tracing_;
};

/// The radius of vertex merging: sample i of the image, counted from 0, has the radius first · (i + 1)^((alpha − 1)/2),
/// with which the bias and the variance of the image both vanish if 0 < alpha < 1 (Knaus and Zwicker 2011, "Progressive
/// Photon Mapping: A Probabilistic Approach").
struct MergeRadius {
  float first;  ///< in world units, > 0
  float alpha;  ///< in (0, 1]; 1: the radius stays as it is

  float at(int sample) const;
};

/// Vertex connection and merging (bidirectional_paths.h): biased, but consistent.
class VcmIntegrator : public BidirectionalIntegrator {
 public:
  /// Scene and camera must outlive it.
  VcmIntegrator(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                const MergeRadius& radius)
      : scene_(scene), camera_(camera), options_(options), radius_(radius) {}
  bool storesLightPaths() const override { return true; }
  void beginSample(int sample) override { current_ = radius_.at(sample); }
  void storeLightPath(Sampler& lightRng, PathStatistics& statistics, std::vector<Photon>& photons) const override;
  void mergeWith(const std::vector<Photon>& photons) override { grid_.emplace(photons, current_); }
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  MergeRadius radius_;
  float current_ = 0;  // radius
  std::optional<PhotonGrid> grid_;
};

}  // namespace lobe
