#pragma once
// Path tracing with BSDF sampling and next-event estimation.

#include "runtime/render/integrators/path_loop.h"

namespace lobe {

/// The sampler of the path loop (path_loop.h) that samples the BSDF.
struct BsdfSampler {
  class Vertex {
   public:
    Vertex(const BsdfSampler&, const SurfaceHit& hit) : hit_(hit) {}
    std::optional<BsdfSample> sample(Sampler& rng, PathStatistics& statistics) const {
      statistics.count(Strategy::bsdf);
      const float choice = rng.stratified();
      return sampleBsdf(hit_, choice, rng.stratified2());
    }
    float pdf(const Vec3& wi) const { return hit_.bsdf->pdf(hit_.wo, wi, hit_.uv); }

    static std::optional<VertexEstimate> estimate() { return std::nullopt; }

   private:
    const SurfaceHit& hit_;
  };
};

class PathIntegrator : public Integrator {
 public:
  /// The scene must outlive it.
  PathIntegrator(const RenderScene& scene, const PathOptions& options) : scene_(scene), options_(options) {}
  Rgb radiance(const Ray& ray, Sampler& rng, PathStatistics& statistics) const override;

 private:
  const RenderScene& scene_;
  PathOptions options_;
};

}  // namespace lobe
