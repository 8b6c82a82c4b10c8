#pragma once
// The path of a photon in training: it is stored at every surface that it reaches from an emitter.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "lobe/sample_storage.h"
#include "runtime/render/lights/environment_guide.h"
#include "runtime/render/training/particle_state.h"

namespace lobe {

/// The result of some photons that are traced one after another.
struct PhotonResult {
  SampleStorage radiance;      ///< every arrival at a surface that is not purely specular
  SampleStorage importance;    ///< requests for importance records where there are none
  std::uint64_t segments = 0;  ///< traced so far; bounds the splitting of photons
};

class PhotonWalk {
 public:
  /// All references must outlive the walk, which appends to the result. importance: guides directions by what was
  /// learnt from importons. maxDepth: PathOptions::maxDepth of the picture.
  PhotonWalk(const RenderScene& scene, const GuidedSampler& importance, Sampler& rng, PhotonResult& result,
             int maxDepth = std::numeric_limits<int>::max())
      : scene_(scene),
        importance_(importance),
        rng_(rng),
        result_(result),
        mostSegments_(std::min(kMaxTrainingDepth, maxDepth - 1)) {}

  /// index: number of the path, passed to the sample storages.
  /// photons: number of photons of the pass, of which this is one; it makes the flux that is stored independent of it.
  void run(const EmittedPhoton& photon, std::uint64_t index, int photons = 1);

 private:
  struct Branch {
    ParticleState state;
    int depth;
    LightPassage passage = {};
  };
  LightPassage passageAfter(const Branch& branch, const SurfaceHit& hit, const Scattered& scattered) const;
  float directFraction(const EmittedPhoton& photon, const LightPassage& passage, const SurfaceHit& hit) const;
  void advance(const EmittedPhoton& photon, const Branch& branch);
  /// Scatters the branches that leave a surface; for vertex see scatter().
  void branchOff(Branch branch, const SurfaceHit& hit, const GuidedSampler::Vertex* vertex);
  void store(const EmittedPhoton& photon, const Branch& branch, const SurfaceHit& hit);
  int applyWeightWindow(Rgb& weight);
  int mostBranches() const;

  const RenderScene& scene_;
  const GuidedSampler& importance_;
  Sampler& rng_;
  PhotonResult& result_;
  const int mostSegments_;  // a path of the picture has at least one more, which begins at the camera
  float fluxScale_ = 1;
  float power_ = 0;  // emitted power, luminance
  std::vector<Branch> waiting_;
  int made_ = 0;  // number of branches made by splitting
};

}  // namespace lobe
