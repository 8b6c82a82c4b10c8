#pragma once
// All emitters of a scene: the choice of a light by place for next-event estimation, and the emission of photons in
// proportion to power.
//
// For next-event estimation, lights form clusters: single lights or nodes of a tree over lights, and tiles of the
// environment. A cluster is chosen with the probabilities of the cell of the receiver, if they have been learnt
// (light_learning.h), otherwise by power; the tree then chooses within the cluster.

#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "runtime/render/geometry/surface_hit.h"
#include "runtime/render/lights/environment_light.h"
#include "runtime/render/lights/light_cells.h"
#include "runtime/render/lights/light_tree.h"

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
  int light = -1;      ///< the number of the light, for LightSelection::probability; −1: the environment
};

struct EmittedPhoton {
  Ray ray;
  Rgb power;                   ///< flux / density of choosing light, point and direction
  bool far;                    ///< emitted at infinity: ray.origin is only a starting point outside the scene
  int light = -1;              ///< the number of the light, for LightSelection::probability; −1: the environment
  bool delta = false;          ///< of a light that only next-event estimation finds
  float areaDensity = 0;       ///< with which the point on the surface was sampled
  Vec3 normal = Vec3::Zero();  ///< of the emitting surface; zero without a surface
  /// The density with which Lights::samplePhoton chooses light, point (area) and direction (solid angle). Point and
  /// directional lights have no choice of point or direction, respectively.
  float density = 0;

  /// The cosine between direction and surface; 1 without a surface.
  float cosine() const { return normal.isZero() ? 1.0f : std::abs(normal.dot(ray.direction)); }
};

/// Bounding sphere of the scene or of a part of it.
struct SceneSphere {
  Vec3 centre = Vec3::Zero();
  float radius = 1;

  float diagonal() const { return 2 * radius; }
  /// The area of the disc to which the sphere projects in every direction.
  float discArea() const { return kPi * radius * radius; }
  /// The starting point of a photon from the direction wi: the point for u in [0,1)² on the disc in that direction.
  Vec3 start(const Vec3& wi, const Vec2& u) const;
  /// The u of the photon that travels along −wi through a point; nullopt: it passes beside the disc.
  std::optional<Vec2> coordinates(const Vec3& point, const Vec3& wi) const;
};

class Lights;

/// Next-event estimation at one receiver. The lights must outlive it. A default-constructed object must not be used.
class LightSelection {
 public:
  LightSelection() = default;
  LightSelection(const Lights& lights, const LightReceiver& at, const float* probabilities)
      : lights_(&lights), at_(at), probabilities_(probabilities) {}

  /// Chooses a light, then a direction towards it; choice uniform in [0,1), with enough random bits for the light and
  /// the triangle of a mesh (Rng::uniformDouble), u in [0,1)². nullopt: a sample of value zero, for example if the
  /// point is behind the light. Spheres are sampled by solid angle from outside, other surfaces by area, the
  /// environment by radiance above its mean: the rest is left to BSDF sampling, so that the two have to be combined.
  std::optional<LightSample> sample(double choice, const Vec2& u) const;

  /// The light sample of another receiver as this receiver would take it: the same point on the same light, or the same
  /// direction towards light at infinity, with this receiver's density, which may be 0. nullopt: no light comes from
  /// there. Not tested for occlusion.
  std::optional<LightSample> same(const LightSample& sample) const;

  /// The density with which sample finds the direction towards `hit` on a light; 0 if the hit is not on the front side
  /// of a light.
  float pdf(const SurfaceHit& hit) const;
  /// The density with which sample finds the origin of a photon that has reached the receiver after `distance`: over
  /// solid angle; for a point light the probability times distance², for a directional light the probability.
  float pdf(const EmittedPhoton& photon, float distance) const;
  /// The density with which sample finds a direction by choosing the environment.
  float environmentPdf(const Vec3& direction) const;
  /// The probability with which sample chooses a light other than the environment.
  float probability(int light) const;

  /// The two steps of sample: the choice of a cluster, which leaves `choice` uniform in [0,1), and sampling of this
  /// cluster; the density still includes that choice.
  int chooseCluster(double& choice) const;
  std::optional<LightSample> sample(int cluster, double choice, const Vec2& u) const;
  float clusterProbability(int cluster) const { return CumulativeProbabilities(probabilities_)[cluster]; }

 private:
  std::optional<LightSample> sampleTile(int cluster, int tile, const Vec2& u) const;

  const Lights* lights_ = nullptr;
  LightReceiver at_ = {Vec3::Zero(), Vec3::Zero()};
  const float* probabilities_ = nullptr;  // cumulative, of the clusters
};

class Lights {
 public:
  /// The scene must outlive the lights. bounds: bounding box of the scene's shapes.
  Lights(const Scene& scene, const Eigen::AlignedBox3f& bounds);

  /// Whether there is no light; then nothing may be sampled.
  bool empty() const { return choice_.total() <= 0; }

  /// A hit as a receiver: on the side from which its ray came, or on both sides of a surface that transmits light.
  static LightReceiver receiver(const SurfaceHit& hit);

  /// Next-event estimation at a receiver.
  LightSelection at(const LightReceiver& receiver) const {
    return {*this, receiver, cells_.empty() ? prior_.data() : cells_.find(receiver)};
  }
  LightSelection at(const SurfaceHit& hit) const { return at(receiver(hit)); }

  /// The number of clusters.
  int clusters() const { return static_cast<int>(clusters_.size()); }
  /// The probability of a cluster without learning.
  float prior(int cluster) const { return CumulativeProbabilities(prior_.data())[cluster]; }
  /// Estimate of the irradiance from a cluster without occlusion, in units of its own.
  float importance(int cluster, const LightReceiver& at) const;
  /// Restricts the part of the scene that counts: the environment and directional lights have the power that enters
  /// this region, so that they do not take all samples from lamps in a room on a large ground plane. The default is the
  /// bounding box of the scene, also if the region is empty. The clusters are made anew: learnt probabilities are
  /// discarded, and no LightSelection, LightCells or EnvironmentGuide from before may be used any more.
  void focus(const Eigen::AlignedBox3f& region);
  /// The bounding sphere of that region.
  const SceneSphere& region() const { return region_; }

  /// Replaces the probabilities of the clusters by learnt ones; an empty object restores the prior.
  void use(LightCells cells) { cells_ = std::move(cells); }

  Rgb environmentRadiance(const Vec3& direction) const;

  /// Samples a photon. The light is chosen by its power, that of the environment and of directional lights by the power
  /// that enters the region. Surfaces are sampled by area and cosine, point and spot lights uniformly over the solid
  /// angle that they light, the environment by radiance. Photons from the environment and from directional lights start
  /// uniformly on the disc to which the bounding sphere of the whole scene projects in that direction, so that they
  /// have more power than others if the region is smaller. Must not be called if empty(). nullopt: a photon of zero
  /// power.
  std::optional<EmittedPhoton> samplePhoton(double choice, const Vec2& u1, const Vec2& u2) const;

  /// EmittedPhoton::density of the photon that travels along the ray of a hit on a light in the opposite direction; 0
  /// if the hit is not on the front side of a light.
  float photonDensity(const SurfaceHit& hit) const;
  /// The same for photons from the environment that travel along −direction.
  float environmentPhotonDensity(const Vec3& direction) const;
  /// The same for the photon that travels along −sample.wi from a point that next-event estimation has chosen.
  float photonDensity(const LightSample& sample) const;

  /// A photon from a direction sampled elsewhere (by a learnt density, for example) that starts on the disc of
  /// `sphere`, outside the scene; its power is not divided by the probability of choosing the environment.
  EmittedPhoton photonFromEnvironment(const EnvironmentSample& from, const SceneSphere& sphere, const Vec2& u) const;
  /// As samplePhoton, with the choice of the environment made.
  std::optional<EmittedPhoton> photonFromEnvironment(const Vec2& u1, const Vec2& u2) const;
  /// EmittedPhoton::density of that photon if it travels along −direction.
  float photonDensityOfEnvironment(const Vec3& direction) const;

  const EnvironmentLight* environment() const { return environment_ ? &*environment_ : nullptr; }
  /// The probability with which samplePhoton chooses the environment.
  float environmentProbability() const {
    return environment_ && !empty() ? choice_.probability(choice_.size() - 1) : 0.0f;
  }

 private:
  friend class LightSelection;
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
  std::optional<EmittedPhoton> areaPhoton(const AreaLight& light, double choice, const Vec2& u1, const Vec2& u2) const;

  /// Sampling of one light, with a density that does not include its choice.
  std::optional<LightSample> sampleLight(int light, const Vec3& point, double choice, const Vec2& u) const;
  /// The density of sampleArea over solid angle. distance2: squared, to a point on the light; cosine: there, on the
  /// front side.
  static float pdfOfArea(const AreaLight& light, const Vec3& point, float distance2, float cosine);

  AreaLight areaLight(const Shape& shape) const;
  void makeChoices();
  std::vector<double> powers() const;
  void choose(const std::vector<double>& powers);
  void makeClusters(const std::vector<double>& powers);
  LightBounds boundsForTree(int light, double power) const;
  const DeltaLight& deltaLight(int light) const {
    return scene_.lights[static_cast<std::size_t>(light) - areas_.size()];
  }
  bool isArea(int light) const { return static_cast<std::size_t>(light) < areas_.size(); }

  /// Lights that are chosen together: a node of the tree (node ≥ 0), a directional light (light ≥ 0), or a tile of the
  /// environment.
  struct Cluster {
    int node = -1;
    int light = -1;
    int tile = -1;
  };

  const Scene& scene_;
  SceneSphere sphere_;  // of the scene's bounding box
  SceneSphere region_;
  std::vector<AreaLight> areas_;
  std::vector<int> lightOfShape_;  // index into areas_, −1: none
  std::optional<EnvironmentLight> environment_;
  std::optional<EnvironmentLight> nextEvent_;  // with the density of next-event estimation
  DiscreteDistribution choice_;                // by power: areas_, then the scene's delta lights, then the environment
  LightTree tree_;                             // over lights at finite distance
  std::vector<Cluster> clusters_;              // the tiles of the environment are the last ones
  std::vector<int> clusterOf_;                 // by light; −1: without power
  std::vector<float> prior_;                   // cumulative probabilities of the clusters
  LightCells cells_;
};

}  // namespace lobe
