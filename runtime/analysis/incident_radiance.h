#pragma once
// What training is to learn, seen from outside of it: points that receive light, the light itself by path tracing, and
// how well densities of directions fit it.
//
// Measured is f(ω) = w(ω) L(ω) cosθ over the hemisphere of a receiver, in luminance. L is all light, by whatever path.
// The weight w takes off what emitter sampling finds already, as it is taken off the particles: light that comes
// straight from an emitter counts with the share that multiple importance sampling leaves to a density of cosθ/π there
// (power heuristic; the density to come is not known to particles either), so delta lights do not count at all. Light
// that was scattered on its way, by a window pane also, counts fully: emitter sampling does not find it.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "runtime/guiding/illumination_cache.h"
#include "runtime/guiding/particle.h"
#include "runtime/render/film/camera.h"
#include "runtime/render/integrators/integrator.h"
#include "runtime/render/lights/render_scene.h"

namespace lobe {

/// A surface point on one of its sides.
struct Receiver {
  SurfacePoint point;
  Vec3 normal;  ///< unit geometric normal on that side

  float cosine(const Vec3& wi) const { return normal.dot(wi); }
};

/// Up to `count` receivers where paths from the camera scatter, other than by delta parts: one from each of `count`
/// paths, any of its vertices alike. Paths that scatter nowhere give none. Depends on the seed only.
std::vector<Receiver> receiversOfPaths(const RenderScene& scene, const RayCamera& camera, int count,
                                       std::uint64_t seed);

/// What of the radiance along a ray, which starts at the receiver, is emitter sampling's: (1 − w) of light straight
/// from an emitter.
Rgb emissionLeftToNee(const RenderScene& scene, const Receiver& receiver, const Ray& ray);

/// Where a ray first meets a surface that is not only delta, on the side it comes from. At delta surfaces it goes where
/// most of the light does. nullopt: it leaves the scene, is absorbed, or gets lost between mirrors.
std::optional<Receiver> firstReceiver(const RenderScene& scene, Ray ray);

/// The density of directions that a look-up gives a receiver, over solid angle; its own cosine where no record serves
/// it. The cache outlives it. Directions are unit, in world space.
class ServedDensity {
 public:
  ServedDensity(const IlluminationCache& cache, const Receiver& receiver);

  const PackedRecord* record() const { return record_; }
  /// The mixture alone. Its mass outside the disc is missing.
  float mixture(const Vec3& wi) const;
  /// 0.5 cosθ/π + 0.5 mixture: what `guided` samples on a diffuse surface.
  float defensive(const Vec3& wi) const;
  /// Draws from the mixture. nullopt: outside the disc.
  std::optional<Vec3> sample(float choice, const Vec2& u) const;

  /// World to local: z is the receiver's normal, x the record's tangent made orthogonal to it.
  const Frame& frame() const { return frame_; }

 private:
  const PackedRecord* record_;
  Frame frame_;
};

/// How many directions are looked into. Halves must be equal, so all are even.
struct IncidentRadianceOptions {
  int cells = 32;      ///< along each axis of the square around the disc
  int perCell = 2;     ///< jittered directions in each cell
  int mixture = 1024;  ///< directions drawn from a density that is near to f already
  int environment = 512;
  std::uint64_t seed = 1;
};

/// f at one receiver, by directions of which each is looked into by two independent paths.
class IncidentRadiance {
 public:
  struct Sample {
    Vec3 wi;
    double density;        ///< of all directions together, over solid angle: 1/density is what the sample stands for
    double first, second;  ///< two independent estimates of f
    bool firstHalf;        ///< which half of the directions it belongs to
  };

  /// paths: any unbiased integrator; the less noise, the better. near: for options.mixture. stream: tells receivers
  /// apart.
  IncidentRadiance(const RenderScene& scene, const Integrator& paths, const Receiver& receiver,
                   const ServedDensity& near, const IncidentRadianceOptions& options, std::uint64_t stream);
  /// From samples made elsewhere.
  explicit IncidentRadiance(std::vector<Sample> samples) : samples_(std::move(samples)) {}

  /// ∫ f dω.
  double irradiance() const;

  /// The variance of f/p for ω drawn from p, over (∫ f)²: ∫ f²/p dω / (∫ f dω)² − 1. The noise of the paths is not in
  /// it: f² is the product of the two estimates, (∫ f)² that of the two halves. +infinity where f > 0 and p = 0.
  /// nullopt: no light was seen.
  std::optional<double> nev(const std::function<double(const Vec3&)>& pdf) const;

  std::span<const Sample> samples() const { return samples_; }

 private:
  std::vector<Sample> samples_;
};

/// The at most `count` nearest particles within maxDistance that a record there would learn from (normals within 45°,
/// light from the front).
std::vector<Particle> particlesAround(const Receiver& receiver, std::span<const Particle> particles, std::size_t count,
                                      float maxDistance);

/// Σ w log p / Σ w over the particles, p over the disc's area (twice that over solid angle). nullopt: no weight.
std::optional<double> meanLogDensity(std::span<const Particle> particles,
                                     const std::function<double(const Vec3&)>& pdf);

}  // namespace lobe
