#pragma once
// Paths from the camera that explore the scene before training.

#include <algorithm>
#include <optional>

#include "runtime/render/film/camera.h"
#include "runtime/render/lights/render_scene.h"

namespace lobe {

/// A ray through a random point of the picture.
Ray sampleCameraRay(const RayCamera& camera, Sampler& rng);

/// The direction (local) in which a path continues by sampling the BSDF. delta: probability of its delta components.
std::optional<Vec3> sampleContinuation(const SurfaceHit& hit, float delta, Sampler& rng);

/// Traces a path through a random point of the picture by sampling BSDFs, with Russian roulette by albedo, and calls
/// visit(hit, delta) at every vertex at which light is sampled in a picture with PathOptions::maxDepth; delta is the
/// probability of the BSDF's delta components there.
template <class Visit>
void walkFromCamera(const RenderScene& scene, const RayCamera& camera, int maxDepth, Sampler& rng, const Visit& visit) {
  constexpr int kMostVertices = 12;
  constexpr float kMostSurvival = 0.95f;
  Ray ray = sampleCameraRay(camera, rng);
  for (int depth = 1; depth <= std::clamp(maxDepth - 1, 1, kMostVertices); ++depth) {
    const std::optional<SurfaceHit> hit = depth == 1 ? scene.firstVisible(ray) : scene.tracer.trace(ray);
    if (!hit || !hit->bsdf || !sidesAgree(*hit, hit->woWorld, hit->wo)) return;
    const float delta = hit->bsdf->deltaProbability(hit->wo, hit->uv);
    visit(*hit, delta);
    const float survival = std::min(kMostSurvival, hit->bsdf->albedo(hit->wo, hit->uv).maxCoeff());
    if (!(rng.uniform() < survival)) return;
    const std::optional<Vec3> wi = sampleContinuation(*hit, delta, rng);
    if (!wi) return;
    const Vec3 direction = hit->frame.toWorld(*wi).normalized();
    if (!sidesAgree(*hit, direction, *wi)) return;
    ray = spawnRay(*hit, direction);
  }
}

}  // namespace lobe
