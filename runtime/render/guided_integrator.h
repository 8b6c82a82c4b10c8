#pragma once
// Path tracing that samples directions by what was learnt: the illumination mixture and the BSDF half and half
// (`guided`, Vorba et al. 2014), or with their product besides (`product`, Herholz et al. 2016).

#include <optional>

#include "runtime/guiding/brdf_caches.h"
#include "runtime/guiding/selection_share.h"
#include "runtime/render/path_loop.h"

namespace lobe {

/// One request for each lobe of each material, material by material.
std::vector<LobeRequest> lobeRequests(const Scene& scene);

class GuidedSampler {
 public:
  /// The caches outlive it. caches: opened for lobeRequests(scene); nullptr: illumination and BSDF only (`guided`).
  GuidedSampler(const Scene& scene, const IlluminationCache& illumination, const BrdfCaches* caches);

  class Vertex {
   public:
    Vertex(const GuidedSampler& sampler, const SurfaceHit& hit);
    Vertex(const Vertex&) = delete;
    Vertex& operator=(const Vertex&) = delete;

    std::optional<BsdfSample> sample(Rng& rng, PathStatistics& statistics) const;
    float pdf(const Vec3& wi) const;
    std::optional<float> reflectedRadiance() const;
    /// Whether there is a record for this point.
    bool hasRecord() const { return record_ != nullptr; }
    GuidingDecision decision() const { return decision_; }
    /// What a direction tells of the record's shares, but for its weight; nullopt where they are not used.
    std::optional<ShareSample> shareSample(const Vec3& wi) const;
    /// The part of the density that is the BSDF's own: pdf(wi) − bsdfShare() · pdf of the BSDF is the mixtures'.
    float bsdfShare() const { return density_ ? density_->bsdfShare() : 1.0f; }

   private:
    void collectReflectance(const GuidedSampler& sampler, const SurfaceHit& hit, const LobeMixture& mixture,
                            float side);
    GuidingDecision decide() const;
    Vec3 toGuide(const Vec3& wi) const { return axes_ * wi; }

    const SurfaceHit& hit_;
    const PackedRecord* record_;  // nullptr: none serves the point, and density_ is empty
    Eigen::Matrix3f axes_;        // from the shading frame to the guide's
    bool described_ = true;       // whether lobes and constant are all of the smooth reflection
    float covered_ = 0;           // share of samples that mixtures may draw
    GuidingDecision decision_ = GuidingDecision::noRecord;
    bool product_ = false;
    Reflectance reflectance_;
    std::optional<GuidedDensity> density_;
  };

 private:
  const IlluminationCache& illumination_;
  const BrdfCaches* caches_;
  std::vector<int> firstRequest_;  // by material
};

class GuidedIntegrator : public Integrator {
 public:
  /// Scene and sampler outlive it.
  GuidedIntegrator(const RenderScene& scene, const PathOptions& options, const GuidedSampler& sampler)
      : scene_(scene), options_(options), sampler_(sampler) {}
  Rgb radiance(const Ray& ray, Rng& rng, PathStatistics& statistics) const override;

 private:
  const RenderScene& scene_;
  PathOptions options_;
  const GuidedSampler& sampler_;
};

}  // namespace lobe
