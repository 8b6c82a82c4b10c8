#pragma once
// One scattering event of a particle in training, for importons and photons alike.

#include <optional>

#include "runtime/render/integrators/guided_integrator.h"

namespace lobe {

/// Training needs no path to be complete: light that has bounced this often is spread out.
inline constexpr int kMaxTrainingDepth = 32;

/// A particle between two surfaces.
struct ParticleState {
  Ray ray;
  Rgb weight;
};

/// What flows along the particle's path: radiance against its direction (importons), or flux along it (photons).
enum class Transport { radiance, flux };

struct Scattered {
  Vec3 wi;         ///< unit, local
  Vec3 direction;  ///< the same in world space
  Rgb weight;      ///< f·|cosθ| over pdf (as flux for photons)
  float pdf;       ///< over solid angle; 0 for the delta part
};

/// Scatters at hit with the smooth part's direction drawn at vertex, which is not null where deltaProbability is under 1.
/// nullopt: the particle is absorbed.
std::optional<Scattered> scatter(const SurfaceHit& hit, const GuidedSampler::Vertex* vertex,
                                 Transport transport, Rng& rng);

/// Russian roulette in proportion to what the surface takes on average, whatever direction was drawn: guiding may make
/// weights small where many particles go, and these must not die of it. Divides the weight of those that survive.
bool survivesAlbedo(Rgb& weight, const SurfaceHit& hit, Rng& rng);

/// The geometric normal on the side that the particle came from.
inline Vec3 normalTowards(const SurfaceHit& hit) {
  return std::copysign(1.0f, hit.normal.dot(hit.woWorld)) * hit.normal;
}

inline bool usable(float weight) {
  return weight > 0 && std::isfinite(weight);
}

}  // namespace lobe
