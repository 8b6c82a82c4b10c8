#include "runtime/render/training/camera_walk.h"

namespace lobe {

Ray sampleCameraRay(const RayCamera& camera, Sampler& rng) {
  const Vec2 pixel = rng.uniform2();
  const int x = static_cast<int>(pixel.x() * static_cast<float>(camera.width()));
  const int y = static_cast<int>(pixel.y() * static_cast<float>(camera.height()));
  return camera.sample(x, y, rng);
}

std::optional<Vec3> sampleContinuation(const SurfaceHit& hit, float delta, Sampler& rng) {
  if (delta > 0 && rng.uniform() < delta) {
    const std::optional<DeltaSample> sample = sampleDelta(hit, rng.uniform());
    return sample ? std::optional(sample->wi) : std::nullopt;
  }
  const float choice = rng.uniform();
  const std::optional<BsdfSample> sample = sampleBsdf(hit, choice, rng.uniform2());
  return sample ? std::optional(sample->wi) : std::nullopt;
}

}  // namespace lobe
