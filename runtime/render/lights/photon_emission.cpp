#include "runtime/render/lights/photon_emission.h"

namespace lobe {

std::optional<EmittedPhoton> PhotonEmission::sample(double choice, const Vec2& u1, const Vec2& u2) const {
  const double environment = guide_ ? lights_->environmentProbability() : 0.0;
  // The environment is the last light: choices below 1 − environment select other lights.
  if (choice < 1 - environment) return lights_->samplePhoton(choice, u1, u2);
  std::optional<EmittedPhoton> photon = guide_->sample((choice - (1 - environment)) / environment, u1, u2);
  if (!photon) return photon;
  photon->power /= static_cast<float>(environment);
  photon->density *= static_cast<float>(environment);
  return photon;
}

float PhotonEmission::environmentDensity(const Vec3& point, const Vec3& direction) const {
  if (!guide_) return lights_->environmentPhotonDensity(direction);
  return lights_->environmentProbability() * guide_->density(point, direction);
}

float PhotonEmission::density(const LightSample& light, const Ray& last) const {
  const bool fromEnvironment = light.light < 0;
  return fromEnvironment ? environmentDensity(last.origin, last.direction) : lights_->photonDensity(light);
}

}  // namespace lobe
