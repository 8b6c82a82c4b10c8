#pragma once
// Traces the particles that training learns from: importons from the camera, which say where records are needed and
// where photons of the environment should start, and photons from the emitters.
//
// What is traced depends on seed and pass only, never on threads.

#include <vector>

#include "runtime/guiding/particle.h"
#include "runtime/render/camera.h"
#include "runtime/render/environment_guide.h"
#include "runtime/render/guided_integrator.h"

namespace lobe {

/// A photon of the environment that travels along −wi through the point would carry `weight` to the picture.
struct EnvironmentUse {
  Vec3 point;
  Vec3 wi;
  float weight;
};

struct ImportonResult {
  std::vector<RecordRequest> requests;
  std::vector<EnvironmentUse> uses;
};

class ParticleTracer {
 public:
  /// All outlive it. guide: nullptr without an environment.
  ParticleTracer(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& sampler,
                 const EnvironmentGuide* guide, std::uint64_t seed);

  ImportonResult traceImportons(int pass, int count) const;
  /// Every arrival at a surface that is not only delta.
  std::vector<Particle> tracePhotons(int pass, int count) const;

 private:
  void traceImporton(Rng& rng, ImportonResult& result) const;
  void addDirectUse(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, const Rgb& throughput, int depth,
                    Rng& rng, ImportonResult& result) const;
  void tracePhoton(Rng& rng, std::vector<Particle>& particles) const;
  std::optional<EmittedPhoton> emit(Rng& rng) const;

  const RenderScene& scene_;
  const RayCamera& camera_;
  const GuidedSampler& sampler_;
  const EnvironmentGuide* guide_;
  std::uint64_t seed_;
};

}  // namespace lobe
