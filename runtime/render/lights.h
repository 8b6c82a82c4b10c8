#pragma once
// All emitters of a scene, sampled by power: for the light that reaches a point, and for photons.

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "runtime/render/environment_light.h"
#include "runtime/render/surface_hit.h"

namespace lobe {

/// Light that would reach a point if nothing were in between.
struct LightSample {
  Vec3 wi;         ///< unit, world space, towards the light
  float distance;  ///< +infinity for the environment
  Rgb radiance;
  float pdf;                           ///< over solid angle at the point, with the choice of the light, > 0
  std::optional<SurfacePoint> source;  ///< the point on the light; none for the environment
};

struct EmittedPhoton {
  Ray ray;
  Rgb power;         ///< flux over the density of choosing light, point and direction
  bool environment;  ///< it came from infinitely far: ray.origin is only a start outside the scene
  /// How densely Lights::sample would choose where it came from, with the choice of the light: over solid angle for the
  /// environment, over area for surfaces.
  float emitterDensity;
  Vec3 normal;  ///< of the surface it left
};

class Lights {
 public:
  /// The scene outlives the lights. bounds: of the scene's shapes.
  Lights(const Scene& scene, const Eigen::AlignedBox3f& bounds);

  /// No light at all: nothing may be sampled.
  bool empty() const { return choice_.total() <= 0; }

  /// Chooses a light, then a direction towards it; choice uniform in [0,1), u in [0,1)². nullopt: a sample of value
  /// zero (the point is behind the light, say). Spheres are sampled by solid angle from outside, all else by area, the
  /// environment by radiance.
  std::optional<LightSample> sample(const Vec3& point, float choice, const Vec2& u) const;

  /// The density with which sample would have found, from `point`, the direction towards `hit` on a light; 0 when it is
  /// not on the front of one.
  float pdf(const Vec3& point, const SurfaceHit& hit) const;

  Rgb environmentRadiance(const Vec3& direction) const;
  /// The density with which sample finds a direction by choosing the environment.
  float environmentPdf(const Vec3& direction) const;

  /// Emission in proportion to power: from surfaces by area and cosine, from the environment by radiance and then
  /// uniformly over the disc that the scene's bounding sphere shows to that direction. Not for empty lights. nullopt: a
  /// photon of power zero.
  std::optional<EmittedPhoton> samplePhoton(float choice, const Vec2& u1, const Vec2& u2) const;

  /// A photon that arrives from a direction sampled elsewhere (a learnt density, say), as samplePhoton makes them; its
  /// power does not contain the probability of choosing the environment.
  EmittedPhoton photonFromEnvironment(const EnvironmentSample& from, const Vec2& u) const;

  /// The u for which photonFromEnvironment makes the photon that travels along −wi through the point (of the scene).
  Vec2 photonCoordinates(const Vec3& point, const Vec3& wi) const;

  /// Emitted flux of all lights, luminance (environment: what enters the bounding sphere).
  double totalPower() const { return choice_.total(); }

  const EnvironmentLight* environment() const { return environment_ ? &*environment_ : nullptr; }
  /// The probability of choosing the environment.
  float environmentProbability() const { return environment_ && !empty() ? choice_.probability(areas_.size()) : 0.0f; }

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

  const Scene& scene_;
  Vec3 centre_ = Vec3::Zero();  // of the bounding sphere
  float radius_ = 1;
  std::vector<AreaLight> areas_;
  std::vector<int> lightOfShape_;  // index into areas_, −1: none
  std::optional<EnvironmentLight> environment_;
  DiscreteDistribution choice_;  // areas_, then the environment
};

}  // namespace lobe
