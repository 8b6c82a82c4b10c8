#pragma once
// A scattering event of an importon or photon in training.

#include <optional>

#include "runtime/render/integrators/guided_integrator.h"

namespace lobe {

/// Longest training path, in segments. Paths may be truncated: light that has bounced this often is nearly uniform.
inline constexpr int kMaxTrainingDepth = 32;

/// A particle between two surfaces.
struct ParticleState {
  Ray ray;
  Rgb weight;
};

struct Scattered {
  Vec3 wi;         ///< unit, local
  Vec3 direction;  ///< the same in world space
  Rgb weight;      ///< f·|cosθ| / pdf, scaled to flux for photons
  float pdf;       ///< over solid angle; 0 for the delta component
};

/// Scatters a particle. The direction of the non-delta component is sampled at `vertex`, which must not be null if
/// deltaProbability is below 1. nullopt: the particle is absorbed.
std::optional<Scattered> scatter(const SurfaceHit& hit, const GuidedSampler::Vertex* vertex, Transport transport,
                                 Sampler& rng);

/// Russian roulette with the surface's albedo as survival probability, whatever direction was sampled: guiding gives
/// small weights to particles in directions where there are many, which must not be terminated for that reason. Divides
/// the weight of survivors by the probability.
bool survivesAlbedo(Rgb& weight, const SurfaceHit& hit, Sampler& rng);

/// The geometric normal on the side from which the particle arrives.
inline Vec3 normalTowards(const SurfaceHit& hit) {
  return std::copysign(1.0f, hit.normal.dot(hit.woWorld)) * hit.normal;
}

inline bool usable(float weight) {
  return weight > 0 && std::isfinite(weight);
}

}  // namespace lobe
