#pragma once
// Guided path tracing: directions are sampled from the learnt illumination mixture and the BSDF, half each (`guided`,
// Vorba et al. 2014), or also from their product (`product`, Herholz et al. 2016).

#include <optional>

#include "lobe/surface_distribution.h"
#include "runtime/render/integrators/path_loop.h"

namespace lobe {

/// One request for each lobe of each material, in the order of the materials.
std::vector<LobeRequest> lobeRequests(const Scene& scene);

/// The sampler of the path loop (path_loop.h) that uses a SurfaceDistribution at each vertex.
class GuidedSampler {
 public:
  /// The field and the caches must outlive it. caches: opened for lobeRequests(scene); nullptr: illumination and BSDF
  /// only (`guided`).
  GuidedSampler(const Scene& scene, const Field& field, const LobeCacheSet* caches);

  class Vertex {
   public:
    Vertex(const GuidedSampler& sampler, const SurfaceHit& hit);
    Vertex(const Vertex&) = delete;
    Vertex& operator=(const Vertex&) = delete;

    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const;
    float pdf(const Vec3& wi) const;
    std::optional<VertexEstimate> estimate() const;
    const SurfaceDistribution& distribution() const { return distribution_; }

   private:
    const GuidedSampler& sampler_;
    const SurfaceHit& hit_;
    SurfaceDistribution distribution_;
  };

 private:
  const Field& field_;
  const LobeCacheSet* caches_;
  std::vector<int> firstRequest_;  // by material
};

class GuidedIntegrator : public Integrator {
 public:
  /// Scene and sampler must outlive it.
  GuidedIntegrator(const RenderScene& scene, const PathOptions& options, const GuidedSampler& sampler)
      : scene_(scene), options_(options), sampler_(sampler) {}
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const override;

 private:
  const RenderScene& scene_;
  PathOptions options_;
  const GuidedSampler& sampler_;
};

}  // namespace lobe
