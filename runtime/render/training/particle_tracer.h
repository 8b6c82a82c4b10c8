#pragma once
// Traces the particles for training in parallel. The results depend only on seed and pass, not on the number of
// threads.

#include <limits>
#include <vector>

#include "runtime/render/training/importon_walk.h"
#include "runtime/render/training/photon_walk.h"

namespace lobe {

class ParticleTracer {
 public:
  /// All references must outlive the tracer. radiance guides importons, importance guides photons. guide: guides the
  /// emission of photons from the environment, nullptr without an environment. maxDepth: PathOptions::maxDepth of the
  /// picture.
  ParticleTracer(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& radiance,
                 const GuidedSampler& importance, const EnvironmentGuide* guide, std::uint64_t seed,
                 int maxDepth = std::numeric_limits<int>::max());

  ImportonResult traceImportons(int pass, int count, const ImportonWishes& wishes) const;
  PhotonResult tracePhotons(int pass, int count) const;

 private:
  std::optional<EmittedPhoton> emit(Sampler& rng) const;

  const RenderScene& scene_;
  const RayCamera& camera_;
  const GuidedSampler& radiance_;
  const GuidedSampler& importance_;
  PhotonEmission emission_;
  std::uint64_t seed_;
  int maxDepth_;
};

}  // namespace lobe
