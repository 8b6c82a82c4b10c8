#include "runtime/render/training/photon_walk.h"

#include <algorithm>

#include "runtime/render/integrators/public_types.h"

namespace lobe {
namespace {

// Weight window, relative to the emitted power.
constexpr float kLowestWeight = 1e-6f;
constexpr float kHighestWeight = 2 + kLowestWeight;
constexpr int kMaxWaiting = 64;  // branches of one photon in the queue
// Branches of one photon in total. Surfaces that reflect more light than they receive would otherwise split it
// endlessly.
constexpr int kMaxBranchesOfPhoton = 512;
// Segments of all photons of a result, 64 for each photon of a chunk of ParticleTracer, after which none of them is
// split. In a closed room of reflectance 1.5, where every photon would be split, a pass of 300,000 photons then stores
// 30 million particles (1.4 GB) instead of 280 million.
constexpr std::uint64_t kMaxSegmentsWithSplitting = std::uint64_t{64} * 256;

}  // namespace

void PhotonWalk::run(const EmittedPhoton& photon, std::uint64_t index, int photons) {
  fluxScale_ = 1.0f / static_cast<float>(photons);
  result_.radiance.beginPath(index);
  result_.importance.beginPath(index);
  power_ = luminance(photon.power);
  if (!usable(power_) || mostSegments_ < 1) return;
  waiting_.push_back({{photon.ray, photon.power}, 1});
  made_ = 0;
  while (!waiting_.empty()) {
    const Branch branch = waiting_.back();
    waiting_.pop_back();
    advance(photon, branch);
  }
}

// Traces one segment, stores the photon at its end point, and scatters the branches that leave from there.
void PhotonWalk::advance(const EmittedPhoton& photon, const Branch& branch) {
  ++result_.segments;
  const std::optional<SurfaceHit> hit = scene_.tracer.trace(branch.state.ray);
  if (!hit || !hit->bsdf || !sidesAgree(*hit, hit->woWorld, hit->wo)) return;
  const bool smooth = hit->bsdf->deltaProbability(hit->wo, hit->uv) < 1;
  if (smooth) store(photon, branch, *hit);
  if (branch.depth == mostSegments_) return;
  if (!smooth) return branchOff(branch, *hit, nullptr);
  const GuidedSampler::Vertex vertex(importance_, *hit);
  if (!vertex.distribution().hasRecord())
    result_.importance.requestRecord(asFloats(hit->position), asFloats(normalTowards(*hit)));
  branchOff(branch, *hit, &vertex);
}

void PhotonWalk::branchOff(Branch branch, const SurfaceHit& hit, const GuidedSampler::Vertex* vertex) {
  const int branches = applyWeightWindow(branch.state.weight);
  for (int i = 0; i < branches; ++i) {
    const std::optional<Scattered> scattered = scatter(hit, vertex, Transport::flux, rng_);
    if (!scattered) continue;
    Rgb weight = branch.state.weight * scattered->weight;
    if (survivesAlbedo(weight, hit, rng_))
      waiting_.push_back(
          {{spawnRay(hit, scattered->direction), weight}, branch.depth + 1, passageAfter(branch, hit, *scattered)});
  }
}

LightPassage PhotonWalk::passageAfter(const Branch& branch, const SurfaceHit& hit, const Scattered& scattered) const {
  LightPassage passage = branch.passage;
  if (scattered.pdf > 0)
    passage.scatter();
  else
    passage.pass(hit, scattered.wi, scene_.shadowSurfaces);
  return passage;
}

/// The fraction of a photon's light that next-event estimation leaves to BSDF sampling: the multiple importance weight
/// of BSDF sampling, for which cosθ/π replaces the density that is not yet known. Zero for delta lights, which BSDF
/// sampling does not find.
float PhotonWalk::directFraction(const EmittedPhoton& photon, const LightPassage& passage,
                                 const SurfaceHit& hit) const {
  if (!passage.specular) return 1;
  if (photon.delta) return 0;
  const bool fromEnvironment = photon.light < 0;
  if (!passage.found(fromEnvironment)) return 1;
  const LightSelection nextEvent = scene_.lights.at(hit);
  float emitter = 0;
  if (fromEnvironment) {
    emitter = nextEvent.environmentPdf(hit.woWorld);
  } else {
    const float distance = passage.distance + hit.distance;
    const float cosineAtLight = std::abs(photon.normal.dot(photon.ray.direction));
    emitter =
        nextEvent.probability(photon.light) * photon.areaDensity * distance * distance / std::max(cosineAtLight, 1e-6f);
  }
  const float cosine = std::abs(hit.normal.dot(hit.woWorld));
  return misWeight(std::max(cosine * kInvPi, 1e-6f), emitter);
}

void PhotonWalk::store(const EmittedPhoton& photon, const Branch& branch, const SurfaceHit& hit) {
  const LightPassage& passage = branch.passage;
  const bool straight = passage.specular && passage.followed && !passage.bent;
  const float flux = luminance(branch.state.weight);
  const float weight = flux * directFraction(photon, passage, hit);
  const float distance = passage.distance + hit.distance;
  if (usable(weight))
    result_.radiance.addPhoton(asFloats(hit.position), asFloats(normalTowards(hit)), asFloats(hit.woWorld), weight,
                               straight && photon.far ? kInfinity
                               : straight             ? distance
                                                      : hit.distance,
                               flux * fluxScale_);
}

// Number of branches that continue. Below the window, Russian roulette may terminate the photon; above it the photon is
// split, so that no particle has a very large weight.
int PhotonWalk::applyWeightWindow(Rgb& weight) {
  const float relative = luminance(weight) / power_;
  if (!usable(relative)) return 0;
  if (relative < kLowestWeight) {
    weight *= kLowestWeight / relative;
    return rng_.uniform() * kLowestWeight < relative ? 1 : 0;
  }
  if (relative <= kHighestWeight) return 1;
  const int branches = std::min(static_cast<int>(std::min(relative / 2, 1e3f)) + 1, mostBranches());
  made_ += branches;
  weight /= static_cast<float>(branches);
  return branches;
}

// Number of branches into which a particle may be split, at least 1. It depends only on what was traced before, so that
// estimates are unbiased: a particle that is not split keeps its weight.
int PhotonWalk::mostBranches() const {
  if (result_.segments >= kMaxSegmentsWithSplitting) return 1;
  return std::max(1, std::min(kMaxWaiting - static_cast<int>(waiting_.size()), kMaxBranchesOfPhoton - made_));
}

}  // namespace lobe
