#pragma once
// One path from the camera in training. It says where records are needed, where photons of the environment should
// start, how important light is that travels against it, and what light it found itself.

#include <array>
#include <vector>

#include "runtime/guiding/particle.h"
#include "runtime/render/camera.h"
#include "runtime/render/particle_flight.h"

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
  std::vector<Particle> importance;  ///< what arrived from the camera after a first scattering
  std::vector<Particle> samples;    ///< incident light that the path found: weight L cosθ over the direction's density
  std::vector<ShareSample> shares;  ///< of the vertices that the product was sampled at
};

/// What to spend time on.
struct ImportonWishes {
  bool uses = false;        ///< the scene has an environment that photons may start from
  bool importance = false;  ///< photons are to be guided
  bool samples = false;     ///< records learn from camera paths
  bool shares = false;      ///< records learn from them how often the BSDF is to choose
};

class ImportonWalk {
 public:
  /// All outlive it; the walk appends to the result.
  ImportonWalk(const RenderScene& scene, const GuidedSampler& sampler, const ImportonWishes& wishes, Rng& rng,
               ImportonResult& result)
      : scene_(scene), sampler_(sampler), wishes_(wishes), rng_(rng), result_(result) {}

  void run(const Ray& cameraRay);

 private:
  struct Vertex {
    Particle particle;  // its weight still without the radiance
    Rgb carried;        // the flight's weight behind this vertex, before Russian roulette
    float radiance = 0;
    std::optional<ShareSample> share;  // its weight without the radiance as well
  };
  bool advance();
  void arrive(const SurfaceHit& hit);
  void escape();
  void addDirectLight(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, float smoothShare);
  void addEnvironmentLight(const SurfaceHit& hit, const Vec3& wi, const Rgb& light, float weight);
  void collect(const Rgb& light);
  void remember(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, const Scattered& scattered);

  const RenderScene& scene_;
  const GuidedSampler& sampler_;
  const ImportonWishes wishes_;
  Rng& rng_;
  ImportonResult& result_;

  Flight flight_;
  int depth_ = 0;
  float pdf_ = 0;                // of the last direction; 0 after the camera or a delta part
  bool scattered_ = false;       // not by delta parts alone
  bool awaitsDistance_ = false;  // of the last vertex
  Vec3 previous_ = Vec3::Zero();
  std::array<Vertex, kMaxTrainingDepth> vertices_;
  int count_ = 0;
};

}  // namespace lobe
