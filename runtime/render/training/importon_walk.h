#pragma once
// One path from the camera in training. It says where records are needed, where photons of the environment should
// start, how important light is that travels against it, and what light it found itself.

#include <cstdint>
#include <vector>

#include "lobe/path_recorder.h"
#include "runtime/render/film/camera.h"
#include "runtime/render/integrators/public_types.h"
#include "runtime/render/training/particle_state.h"

namespace lobe {

/// A photon of the environment that travels along −wi through the point would carry `weight` to the picture.
struct EnvironmentUse {
  Vec3 point;
  Vec3 wi;
  float weight;
};

struct ImportonResult {
  SampleStorage radiance;    ///< incident light that the paths found, and requests for records of it
  SampleStorage importance;  ///< what arrived from the camera after a first scattering, as photons
  std::vector<EnvironmentUse> uses;
};

/// What to spend time on.
struct ImportonWishes {
  bool uses = false;        ///< the scene has an environment that photons may start from
  bool importance = false;  ///< photons are to be guided
  bool samples = false;     ///< records learn from camera paths
  bool fractions = false;   ///< records learn from them how often the BSDF is to choose
};

class ImportonWalk {
 public:
  /// All outlive it; the walk appends to the result.
  ImportonWalk(const RenderScene& scene, const GuidedSampler& sampler, const ImportonWishes& wishes, Rng& rng,
               ImportonResult& result)
      : scene_(scene),
        sampler_(sampler),
        wishes_(wishes),
        rng_(rng),
        result_(result),
        recorder_(result.radiance, {wishes.samples, wishes.fractions}) {}

  /// index: of the path, told to the storages.
  void run(const Ray& cameraRay, std::uint64_t index);

 private:
  bool advance();
  /// Scatters. vertex: as scatter takes it. False: the path is over.
  bool goOn(const SurfaceHit& hit, const GuidedSampler::Vertex* vertex);
  void arrive(const SurfaceHit& hit);
  void escape();
  void addDirectLight(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, float smoothFraction);
  void addEnvironmentLight(const SurfaceHit& hit, const Vec3& wi, const Rgb& light, float weight);
  void collect(const Rgb& light) { recorder_.addLight(asFloats(light)); }
  void remember(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, const Scattered& scattered);

  const RenderScene& scene_;
  const GuidedSampler& sampler_;
  const ImportonWishes wishes_;
  Rng& rng_;
  ImportonResult& result_;

  ParticleState state_;
  int depth_ = 0;
  float pdf_ = 0;                // of the last direction; 0 after the camera or a delta part
  bool scattered_ = false;       // not by delta parts alone
  bool awaitsDistance_ = false;  // of the last vertex
  Vec3 previous_ = Vec3::Zero();
  PathRecorder recorder_;
};

}  // namespace lobe
