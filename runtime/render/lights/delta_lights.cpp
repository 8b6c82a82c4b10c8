#include "runtime/render/lights/delta_lights.h"

#include <cmath>

namespace lobe {
namespace {

/// The falloff of a spot light in a direction, a factor of its intensity.
float falloff(const SpotLight& spot, const Vec3& direction) {
  // Computed from the chord, because the cosine of a small angle is inaccurate.
  const float angle = 2.0f * std::asin(std::min(1.0f, 0.5f * (direction - spot.direction).norm()));
  if (angle >= spot.cutoff) return 0.0f;
  return angle <= spot.beamWidth ? 1.0f : (spot.cutoff - angle) / (spot.cutoff - spot.beamWidth);
}

/// 1 − cos of the cutoff, without cancellation.
double coneHeight(const SpotLight& spot) {
  const double sine = std::sin(0.5 * spot.cutoff);
  return 2.0 * sine * sine;
}

/// ∫ falloff dω = 2π (1 − (sin c − sin b) / (c − b)).
double solidAngle(const SpotLight& spot) {
  const double mean = 0.5 * (static_cast<double>(spot.cutoff) + spot.beamWidth);
  const double half = 0.5 * (static_cast<double>(spot.cutoff) - spot.beamWidth);
  return 2.0 * kPi * (1.0 - std::cos(mean) * (half > 1e-6 ? std::sin(half) / half : 1.0));
}

std::optional<LightSample> fromPosition(const Vec3& position, const Rgb& intensity, const Vec3& point) {
  const Vec3 toLight = position - point;
  const float distance = toLight.norm();
  const Rgb irradiance = intensity / (distance * distance);
  if (!irradiance.isFinite().all() || !(irradiance.maxCoeff() > 0.0f)) return std::nullopt;
  return LightSample{
      toLight / distance, distance, irradiance, 1.0f, SurfacePoint{position, Vec3::Zero(), Vec2::Zero(), 0.0f}, true};
}

/// Area of the unit square of texture coordinates on the plane at distance 1.
double areaOf(const ProjectedTexture& projected) {
  return 1.0 / (static_cast<double>(projected.u.norm()) * projected.v.norm());
}

/// The intensity of a spot light in a direction.
Rgb intensityOf(const SpotLight& light, const Vec3& direction) {
  const float attenuation = falloff(light, direction);
  if (!(attenuation > 0.0f)) return Rgb::Zero();
  const Rgb intensity = light.intensity * attenuation;
  if (!light.texture) return intensity;
  return intensity * light.texture->texture->eval(light.texture->uvOf(light.direction, direction));
}

/// The intensity of a projector in a direction. The factor 1/cos³ makes the irradiance on the image plane independent
/// of the position.
Rgb intensityOf(const ProjectorLight& light, const Vec3& direction) {
  const float cosine = light.direction.dot(direction);
  if (!(cosine > 0.0f)) return Rgb::Zero();
  const Vec2 uv = light.image.uvOf(light.direction, direction);
  if (!((uv.array() >= 0.0f).all() && (uv.array() <= 1.0f).all())) return Rgb::Zero();
  return light.image.texture->eval(uv) * (kPi * light.scale / (cosine * cosine * cosine));
}

std::optional<LightSample> illuminateBy(const PointLight& light, const Vec3& point) {
  return fromPosition(light.position, light.intensity, point);
}
std::optional<LightSample> illuminateBy(const SpotLight& light, const Vec3& point) {
  return fromPosition(light.position, intensityOf(light, (point - light.position).normalized()), point);
}
std::optional<LightSample> illuminateBy(const ProjectorLight& light, const Vec3& point) {
  return fromPosition(light.position, intensityOf(light, (point - light.position).normalized()), point);
}
std::optional<LightSample> illuminateBy(const DirectionalLight& light, const Vec3&) {
  return LightSample{-light.direction, kInfinity, light.irradiance, 1.0f, std::nullopt, true};
}

double fluxOf(const PointLight& light, const SceneSphere&) {
  return 4.0 * kPi * luminance(light.intensity);
}
double fluxOf(const SpotLight& light, const SceneSphere&) {
  const Rgb intensity = light.texture ? Rgb(light.intensity * light.texture->texture->mean()) : light.intensity;
  return solidAngle(light) * luminance(intensity);
}
double fluxOf(const ProjectorLight& light, const SceneSphere&) {
  return kPi * light.scale * areaOf(light.image) * luminance(light.image.texture->mean());
}
double fluxOf(const DirectionalLight& light, const SceneSphere& sphere) {
  const double radius = sphere.radius;
  return kPi * radius * radius * luminance(light.irradiance);
}

float densityOf(const PointLight&, const SceneSphere&, const Vec3&) {
  return 0.25f * kInvPi;
}
float densityOf(const SpotLight& light, const SceneSphere&, const Vec3&) {
  return static_cast<float>(0.5 * kInvPi / coneHeight(light));
}
float densityOf(const ProjectorLight& light, const SceneSphere&, const Vec3& direction) {
  // Uniform over the image on the plane at distance 1, of which a solid angle covers 1/cos³.
  const double cosine = light.direction.dot(direction);
  return static_cast<float>(1.0 / (areaOf(light.image) * cosine * cosine * cosine));
}
float densityOf(const DirectionalLight&, const SceneSphere& sphere, const Vec3&) {
  return kInvPi / (sphere.radius * sphere.radius);
}

EmittedPhoton photon(const Ray& ray, const Rgb& power, bool far) {
  return {ray, power, far, -1, true};
}

std::optional<EmittedPhoton> emitFrom(const PointLight& light, const SceneSphere&, const Vec2&, const Vec2& u) {
  return photon({light.position, squareToSphere(u)}, light.intensity * (4.0f * kPi), false);
}
std::optional<EmittedPhoton> emitFrom(const SpotLight& light, const SceneSphere&, const Vec2&, const Vec2& u) {
  const auto height = static_cast<float>(coneHeight(light));
  const float fromPole = u.x() * height;
  const float sine = std::sqrt(fromPole * (2.0f - fromPole));
  const float azimuth = 2.0f * kPi * u.y();
  const Vec3 local(sine * std::cos(azimuth), sine * std::sin(azimuth), 1.0f - fromPole);
  const Vec3 direction = Frame::fromNormal(light.direction).toWorld(local);
  const Rgb intensity = intensityOf(light, direction);
  if (!(intensity.maxCoeff() > 0.0f)) return std::nullopt;
  return photon({light.position, direction}, intensity * (2.0f * kPi * height), false);
}
std::optional<EmittedPhoton> emitFrom(const ProjectorLight& light, const SceneSphere&, const Vec2&, const Vec2& u) {
  const Rgb irradiance = light.image.texture->eval(u) * (kPi * light.scale);
  if (!(irradiance.maxCoeff() > 0.0f)) return std::nullopt;
  const Vec3 onPlane = light.direction + light.image.u * ((u.x() - 0.5f) / light.image.u.squaredNorm()) +
                       light.image.v * ((u.y() - 0.5f) / light.image.v.squaredNorm());
  const Rgb power = irradiance * static_cast<float>(areaOf(light.image));
  return photon({light.position, onPlane.normalized()}, power, false);
}
std::optional<EmittedPhoton> emitFrom(const DirectionalLight& light, const SceneSphere& sphere, const Vec2& u,
                                      const Vec2&) {
  const Rgb power = light.irradiance * (kPi * sphere.radius * sphere.radius);
  return photon({sphere.start(-light.direction, u), light.direction}, power, true);
}

}  // namespace

double powerOf(const DeltaLight& light, const SceneSphere& sphere) {
  return std::visit([&](const auto& l) { return fluxOf(l, sphere); }, light);
}

std::optional<LightSample> illuminate(const DeltaLight& light, const Vec3& point) {
  return std::visit([&](const auto& l) { return illuminateBy(l, point); }, light);
}

std::optional<EmittedPhoton> emit(const DeltaLight& light, const SceneSphere& sphere, const Vec2& u1, const Vec2& u2) {
  std::optional<EmittedPhoton> emitted = std::visit([&](const auto& l) { return emitFrom(l, sphere, u1, u2); }, light);
  if (!emitted) return std::nullopt;
  emitted->density = emissionDensity(light, sphere, emitted->ray.direction);
  emitted->delta = true;
  return emitted;
}

float emissionDensity(const DeltaLight& light, const SceneSphere& sphere, const Vec3& direction) {
  return std::visit([&](const auto& l) { return densityOf(l, sphere, direction); }, light);
}

}  // namespace lobe
