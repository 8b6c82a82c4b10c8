#pragma once
// All emitters of a scene, chosen mostly in proportion to power, for next-event estimation and for the emission of
// photons.

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "runtime/render/geometry/surface_hit.h"
#include "runtime/render/lights/environment_light.h"

namespace lobe {

/// Light that reaches a point if it is not occluded.
struct LightSample {
  Vec3 wi;         ///< unit, world space, towards the light
  float distance;  ///< infinite for lights at infinity
  Rgb radiance;    ///< for a delta light, the irradiance on a surface that faces it
  float pdf;  ///< over solid angle, including the probability of choosing the light, > 0; for a delta light only that
  /// The point on the light (for a point light without normal and offset); nullopt for lights at infinity.
  std::optional<SurfacePoint> source;
  bool delta = false;  ///< a point or directional light: its multiple importance weight is 1
};

struct EmittedPhoton {
  Ray ray;
  Rgb power;  ///< flux / density of choosing light, point and direction
  bool far;   ///< emitted at infinity: ray.origin is only a starting point outside the scene
  /// The density with which Lights::sample chooses the origin of the photon, with the choice of the light: over solid
  /// angle for the environment, over area for surfaces; infinite for delta lights.
  float emitterDensity;
  Vec3 normal;  ///< of the emitting surface; zero without a surface
};

/// Bounding sphere of the scene.
struct SceneSphere {
  Vec3 centre = Vec3::Zero();
  float radius = 1;

  /// The starting point of a photon from the direction wi: the point for u in [0,1)² on the disc to which the sphere
  /// projects in that direction.
  Vec3 start(const Vec3& wi, const Vec2& u) const;
};

class Lights {
 public:
  /// The scene must outlive the lights. bounds: bounding box of the scene's shapes.
  Lights(const Scene& scene, const Eigen::AlignedBox3f& bounds);

  /// Whether there is no light; then nothing may be sampled.
  bool empty() const { return choice_.total() <= 0; }

  /// Chooses a light, then a direction towards it; choice uniform in [0,1), with enough
  /// random bits for the light and the triangle of a mesh (Rng::uniformDouble), u in [0,1)². nullopt: a sample of value
  /// zero, for example if the point is behind the light. Spheres are sampled by solid angle from outside, other
  /// surfaces by area, the environment by radiance above its mean: the rest is left to BSDF sampling, so that the two
  /// have to be combined.
  std::optional<LightSample> sample(const Vec3& point, double choice, const Vec2& u) const;

  /// The density with which sample finds, from `point`, the direction towards `hit` on a light; 0 if the hit is not on
  /// the front side of a light.
  float pdf(const Vec3& point, const SurfaceHit& hit) const;

  Rgb environmentRadiance(const Vec3& direction) const;
  /// The density with which sample finds a direction by choosing the environment.
  float environmentPdf(const Vec3& direction) const;

  /// Samples a photon in proportion to power: surfaces by area and cosine, point and spot lights uniformly over the
  /// solid angle that they light, the environment by radiance. Photons from the environment and from directional lights
  /// start uniformly on the disc to which the bounding sphere of the scene projects in that direction. Must not be
  /// called if empty(). nullopt: a photon of zero power.
  std::optional<EmittedPhoton> samplePhoton(double choice, const Vec2& u1, const Vec2& u2) const;

  /// A photon from a direction sampled elsewhere (by a learnt density, for example), otherwise as in samplePhoton; its
  /// power is not divided by the probability of choosing the environment.
  EmittedPhoton photonFromEnvironment(const EnvironmentSample& from, const Vec2& u) const;

  /// The u for which photonFromEnvironment returns the photon that travels along −wi through a point of the scene.
  Vec2 photonCoordinates(const Vec3& point, const Vec3& wi) const;

  const EnvironmentLight* environment() const { return environment_ ? &*environment_ : nullptr; }
  /// The probability of choosing the environment.
  float environmentProbability() const {
    return environment_ && !empty() ? choice_.probability(choice_.size() - 1) : 0.0f;
  }

 private:
  struct AreaLight {
    const Shape* shape;
    float area;
    DiscreteDistribution triangles;  // by area, for meshes
  };
  struct PointSample {
    SurfacePoint point;
    float areaDensity;
  };
  PointSample samplePoint(const AreaLight& light, double choice, const Vec2& u) const;
  std::optional<LightSample> sampleArea(const AreaLight& light, const Vec3& point, double choice, const Vec2& u) const;
  std::optional<LightSample> sampleEnvironment(const Vec2& u) const;
  std::optional<EmittedPhoton> areaPhoton(const AreaLight& light, double choice, const Vec2& u1, const Vec2& u2) const;

  void choose(const std::vector<double>& powers);

  const Scene& scene_;
  SceneSphere sphere_;
  std::vector<AreaLight> areas_;
  std::vector<int> lightOfShape_;  // index into areas_, −1: none
  std::optional<EnvironmentLight> environment_;
  std::optional<EnvironmentLight> nextEvent_;  // with the density of next-event estimation
  DiscreteDistribution choice_;                // areas_, then the scene's delta lights, then the environment
};

}  // namespace lobe
