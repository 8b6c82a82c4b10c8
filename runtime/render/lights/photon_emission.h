#pragma once
// Where light paths start: emission in proportion to power, with a guide for that of the environment.

#include "runtime/render/lights/environment_guide.h"
#include "runtime/render/lights/render_scene.h"

namespace lobe {

class PhotonEmission {
 public:
  /// guide: for photons from the environment; nullptr: they are sampled as by Lights::samplePhoton. Both must outlive
  /// it.
  explicit PhotonEmission(const Lights& lights, const EnvironmentGuide* guide = nullptr)
      : lights_(&lights), guide_(lights.environmentProbability() > 0 ? guide : nullptr) {}

  /// As Lights::samplePhoton.
  std::optional<EmittedPhoton> sample(double choice, const Vec2& u1, const Vec2& u2) const;

  // The densities with which sample finds photons, EmittedPhoton::density.

  /// Of the photon that travels from a hit on a light to the origin of its ray.
  float density(const SurfaceHit& hit) const { return lights_->photonDensity(hit); }
  /// Of the photon from the environment that travels along −direction through a point.
  float environmentDensity(const Vec3& point, const Vec3& direction) const;
  /// Of the photon from a light sample that arrives along `last`, the last segment of the way to the light.
  float density(const LightSample& light, const Ray& last) const;

 private:
  const Lights* lights_;
  const EnvironmentGuide* guide_;
};

}  // namespace lobe
