#pragma once
// All emitters of a scene, chosen mostly by power: for the light that reaches a point, and for photons.

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "runtime/render/geometry/surface_hit.h"
#include "runtime/render/lights/environment_light.h"

namespace lobe {

/// Light that would reach a point if nothing were in between.
struct LightSample {
  Vec3 wi;         ///< unit, world space, towards the light
  float distance;  ///< +infinity for light from infinitely far
  Rgb radiance;    ///< of a delta light: the irradiance on a surface that faces it
  float pdf;  ///< over solid angle at the point, with the choice of the light, > 0; of a delta light: of its choice
  /// The point on the light (of a point light: without normal and offset); none for light from infinitely far.
  std::optional<SurfacePoint> source;
  bool delta = false;  ///< from a point or in a single direction: nothing else finds it, its share of an estimate is 1
};

struct EmittedPhoton {
  Ray ray;
  Rgb power;  ///< flux over the density of choosing light, point and direction
  bool far;   ///< it came from infinitely far: ray.origin is only a start outside the scene
  /// How densely Lights::sample would choose where it came from, with the choice of the light: over solid angle for the
  /// environment, over area for surfaces; infinite for delta lights.
  float emitterDensity;
  Vec3 normal;  ///< of the surface it left; zero when it left none
};

/// Contains all shapes.
struct SceneSphere {
  Vec3 centre = Vec3::Zero();
  float radius = 1;

  /// The point of the disc that the sphere shows to the direction wi from which u in [0,1)² lets a photon start.
  Vec3 start(const Vec3& wi, const Vec2& u) const;
};

class Lights {
 public:
  /// The scene outlives the lights. bounds: of the scene's shapes.
  Lights(const Scene& scene, const Eigen::AlignedBox3f& bounds);

  /// No light at all: nothing may be sampled.
  bool empty() const { return choice_.total() <= 0; }

  /// Chooses a light, then a direction towards it; choice uniform in [0,1), u in [0,1)². nullopt: a sample of value
  /// zero (the point is behind the light, say). Spheres are sampled by solid angle from outside, other surfaces by
  /// area, the environment by radiance.
  std::optional<LightSample> sample(const Vec3& point, float choice, const Vec2& u) const;

  /// The density with which sample would have found, from `point`, the direction towards `hit` on a light; 0 when it is
  /// not on the front of one.
  float pdf(const Vec3& point, const SurfaceHit& hit) const;

  Rgb environmentRadiance(const Vec3& direction) const;
  /// The density with which sample finds a direction by choosing the environment.
  float environmentPdf(const Vec3& direction) const;

  /// Emission in proportion to power: from surfaces by area and cosine, from points uniformly over the solid angle they
  /// light, from the environment by radiance and, as from directional lights, uniformly over the disc that the scene's
  /// bounding sphere shows to that direction. Not for empty lights. nullopt: a photon of power zero.
  std::optional<EmittedPhoton> samplePhoton(float choice, const Vec2& u1, const Vec2& u2) const;

  /// A photon that arrives from a direction sampled elsewhere (a learnt density, say), as samplePhoton makes them; its
  /// power does not contain the probability of choosing the environment.
  EmittedPhoton photonFromEnvironment(const EnvironmentSample& from, const Vec2& u) const;

  /// The u for which photonFromEnvironment makes the photon that travels along −wi through the point (of the scene).
  Vec2 photonCoordinates(const Vec3& point, const Vec3& wi) const;

  /// Emitted flux of all lights, luminance (from infinitely far: what enters the bounding sphere).
  double totalPower() const { return totalPower_; }

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
  PointSample samplePoint(const AreaLight& light, float choice, const Vec2& u) const;
  std::optional<LightSample> sampleArea(const AreaLight& light, const Vec3& point, float choice, const Vec2& u) const;
  std::optional<LightSample> sampleEnvironment(const Vec2& u) const;
  std::optional<EmittedPhoton> areaPhoton(const AreaLight& light, float choice, const Vec2& u1, const Vec2& u2) const;

  void choose(const std::vector<double>& powers);

  const Scene& scene_;
  SceneSphere sphere_;
  std::vector<AreaLight> areas_;
  std::vector<int> lightOfShape_;  // index into areas_, −1: none
  std::optional<EnvironmentLight> environment_;
  DiscreteDistribution choice_;  // areas_, then the scene's delta lights, then the environment
  double totalPower_ = 0;
};

}  // namespace lobe
