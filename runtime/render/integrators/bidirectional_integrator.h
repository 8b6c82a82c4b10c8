#pragma once
// Bidirectional path tracing (bidirectional_paths.h) with BSDF sampling, or guided in both directions, and vertex
// connection and merging.

#include "runtime/render/integrators/guided_integrator.h"
#include "runtime/render/integrators/path_integrator.h"

namespace lobe {

class BdptIntegrator : public BidirectionalIntegrator {
 public:
  /// Scene and camera must outlive it. Of the options, counts is not used: Russian roulette is by throughput.
  BdptIntegrator(const RenderScene& scene, const RayCamera& camera, const PathOptions& options)
      : scene_(scene), camera_(camera), options_(options) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>& splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
};

class GuidedBdptIntegrator : public BidirectionalIntegrator {
 public:
  /// As BdptIntegrator. camera: guides camera paths; light: guides light paths by the importance that arrives from the
  /// camera. Both must outlive it.
  GuidedBdptIntegrator(const RenderScene& scene, const RayCamera& sensor, const PathOptions& options,
                       const GuidedSampler& camera, const GuidedSampler& light)
      : scene_(scene), camera_(sensor), options_(options), cameraGuide_(camera), lightGuide_(light) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>& splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  const GuidedSampler& cameraGuide_;
  const GuidedSampler& lightGuide_;
};

/// Guided path tracing whose camera paths are combined with light paths (light_tracing.h).
class GuidedLightIntegrator : public BidirectionalIntegrator {
 public:
  /// Scene, camera and guide must outlive it, and what they refer to. Light paths are sampled by the BSDF.
  GuidedLightIntegrator(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                        const GuidedSampler& guide, const LightTracing& tracing)
      : scene_(scene), camera_(camera), options_(options), guide_(guide), tracing_(tracing) {}
  Rgb radiance(const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>& splats) const override;

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
               std::vector<Splat>& splats) const override;

 private:
  const RenderScene& scene_;
  const RayCamera& camera_;
  PathOptions options_;
  MergeRadius radius_;
  float current_ = 0;  // radius
  std::optional<PhotonGrid> grid_;
};

}  // namespace lobe
