#pragma once
// A camera path in training. It requests records, and collects where photons from the environment should start, the
// importance that arrives at surfaces, and the incident radiance that the path finds.

#include <cstdint>
#include <limits>
#include <vector>

#include "lobe/path_recorder.h"
#include "runtime/render/film/camera.h"
#include "runtime/render/integrators/public_types.h"
#include "runtime/render/training/particle_state.h"

namespace lobe {

/// A photon from the environment that travels along −wi through the point would contribute `weight` to the image.
struct EnvironmentUse {
  Vec3 point;
  Vec3 wi;
  float weight;
};

struct ImportonResult {
  SampleStorage radiance;    ///< incident radiance found by the paths, and requests for radiance records
  SampleStorage importance;  ///< importance that arrives after the first non-delta scattering, stored as photons
  std::vector<EnvironmentUse> uses;
};

/// What a walk collects.
struct ImportonWishes {
  bool uses = false;        ///< where photons should start; only for scenes with an environment
  bool importance = false;  ///< importance, to guide photons
  bool samples = false;     ///< incident radiance, from which records learn
  bool fractions = false;   ///< samples from which records learn their BSDF sampling fractions
};

class ImportonWalk {
 public:
  /// All references must outlive the walk, which appends to the result. maxDepth: PathOptions::maxDepth of the picture.
  ImportonWalk(const RenderScene& scene, const GuidedSampler& sampler, const ImportonWishes& wishes, Sampler& rng,
               ImportonResult& result, int maxDepth = std::numeric_limits<int>::max())
      : scene_(scene),
        sampler_(sampler),
        wishes_(wishes),
        rng_(rng),
        result_(result),
        maxDepth_(maxDepth),
        recorder_(result.radiance, {wishes.samples, wishes.fractions}) {}

  /// index: number of the path, passed to the sample storages.
  void run(const Ray& cameraRay, std::uint64_t index);

 private:
  bool advance();
  /// Scatters; for vertex see scatter(). Returns false when the path ends.
  bool goOn(const SurfaceHit& hit, const GuidedSampler::Vertex* vertex);
  void arrive(const SurfaceHit& hit);
  void escape();
  void addDirectLight(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, float smoothFraction);
  void collect(const Rgb& light) { recorder_.addLight(asFloats(light)); }
  void remember(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, const Scattered& scattered);

  const RenderScene& scene_;
  const GuidedSampler& sampler_;
  const ImportonWishes wishes_;
  Sampler& rng_;
  ImportonResult& result_;
  const int maxDepth_;

  ParticleState state_;
  int depth_ = 0;
  EmissionWeight emissionWeight_;
  bool scattered_ = false;  // at a non-delta component at least once
  PathRecorder recorder_;
};

}  // namespace lobe
