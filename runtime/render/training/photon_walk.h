#pragma once
// One photon in training: light carried from an emitter to all surfaces that it meets.

#include <cstdint>
#include <vector>

#include "lobe/sample_storage.h"
#include "runtime/render/training/environment_guide.h"
#include "runtime/render/training/particle_state.h"

namespace lobe {

struct PhotonResult {
  SampleStorage radiance;    ///< every arrival at a surface that is not only delta
  SampleStorage importance;  ///< requests for records where guiding by importance found none
};

class PhotonWalk {
 public:
  /// All outlive it; the walk appends to the result. importance: guides directions, it has learnt from importons.
  PhotonWalk(const RenderScene& scene, const GuidedSampler& importance, Rng& rng, PhotonResult& result)
      : scene_(scene), importance_(importance), rng_(rng), result_(result) {}

  /// index: of the path, told to the storages.
  void run(const EmittedPhoton& photon, std::uint64_t index);

 private:
  struct Branch {
    ParticleState state;
    int depth;
  };
  void advance(const EmittedPhoton& photon, const Branch& branch);
  /// Scatters the branches that leave a surface. vertex: as scatter takes it.
  void branchOff(Branch branch, const SurfaceHit& hit, const GuidedSampler::Vertex* vertex);
  void store(const EmittedPhoton& photon, const Branch& branch, const SurfaceHit& hit);
  int applyWeightWindow(Rgb& weight);

  const RenderScene& scene_;
  const GuidedSampler& importance_;
  Rng& rng_;
  PhotonResult& result_;
  float power_ = 0;  // emitted, luminance
  std::vector<Branch> waiting_;
  int made_ = 0;  // branches by splitting
};

}  // namespace lobe
