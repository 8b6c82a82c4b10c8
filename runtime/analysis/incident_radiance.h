#pragma once
// Incident-radiance reference: surface points that receive light, the incident radiance there by path tracing, and
// measures of how well densities of directions fit it.
//
// The reference is f(ω) = w(ω) L(ω) cosθ over the hemisphere of a receiver, in luminance, where L is the radiance of
// all paths. The weight w removes the part that next-event estimation (NEE) finds, as it is removed from the weights of
// particles. Direct light from an emitter is weighted by the multiple importance weight (power heuristic) of a
// density cosθ/π against NEE, because the actual density is unknown when particles are stored; delta lights therefore
// do not count. Scattered light, including light through window panes, counts fully, because NEE does not find it.

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

/// A surface point and the side of the surface on which light arrives.
struct Receiver {
  SurfacePoint point;
  Vec3 normal;  ///< unit geometric normal on that side

  float cosine(const Vec3& wi) const { return normal.dot(wi); }
};

/// Up to `count` receivers where camera paths scatter at non-delta components: one from each of `count` paths, chosen
/// uniformly among its vertices. Paths without such a vertex contribute none. Depends only on the seed.
std::vector<Receiver> receiversOfPaths(const RenderScene& scene, const RayCamera& camera, int count,
                                       std::uint64_t seed);

/// The part of the radiance along a ray from the receiver that NEE finds: (1 − w) times the radiance straight from an
/// emitter.
Rgb emissionLeftToNee(const RenderScene& scene, const Receiver& receiver, const Ray& ray);

/// The first surface along a ray of the camera that is not purely specular (delta), on the side from which the ray
/// arrives. At delta surfaces the ray follows the most probable direction. nullopt if it leaves the scene, is absorbed,
/// or meets too many delta surfaces.
std::optional<Receiver> firstReceiver(const RenderScene& scene, Ray ray);

/// The density of directions over solid angle that the cache provides for a receiver, or the cosine density if no
/// record serves it. The cache must outlive it. Directions are unit vectors in world space.
class ServedDensity {
 public:
  ServedDensity(const IlluminationCache& cache, const Receiver& receiver);

  const PackedRecord* record() const { return record_; }
  /// The density of the mixture alone. Its mass outside the disc is not included.
  float mixture(const Vec3& wi) const;
  /// 0.5 cosθ/π + 0.5 mixture, the density that the integrator `guided` samples on a diffuse surface.
  float defensive(const Vec3& wi) const;
  /// Samples the mixture; nullopt if the sample is outside the disc.
  std::optional<Vec3> sample(float choice, const Vec2& u) const;

  /// The local frame: z is the receiver's normal, x the record's tangent made orthogonal to it.
  const Frame& frame() const { return frame_; }

 private:
  const PackedRecord* record_;
  Frame frame_;
};

/// Numbers of sampled directions. They must be even, because the samples are divided into two halves of equal size.
struct IncidentRadianceOptions {
  int cells = 32;      ///< along each axis of the square around the disc
  int perCell = 2;     ///< jittered directions in each cell
  int mixture = 1024;  ///< directions sampled from a density that approximates f
  int environment = 512;
  std::uint64_t seed = 1;
};

/// Samples of f at one receiver. The radiance along each sampled direction is estimated by two independent paths.
class IncidentRadiance {
 public:
  struct Sample {
    Vec3 wi;
    double density;  ///< combined density of all sampled directions over solid angle: the sample has weight 1/density
    double first, second;  ///< two independent estimates of f
    bool firstHalf;        ///< which half of the sampled directions it belongs to
  };

  /// paths: any unbiased integrator, preferably with low noise. near: the density for options.mixture. stream: the
  /// random stream, different for each receiver.
  IncidentRadiance(const RenderScene& scene, const Integrator& paths, const Receiver& receiver,
                   const ServedDensity& near, const IncidentRadianceOptions& options, std::uint64_t stream);
  /// Uses samples made elsewhere.
  explicit IncidentRadiance(std::vector<Sample> samples) : samples_(std::move(samples)) {}

  /// ∫ f dω.
  double irradiance() const;

  /// The relative variance (NEV) of f/p for ω sampled from p: ∫ f²/p dω / (∫ f dω)² − 1. The noise of the paths is
  /// excluded: f² is estimated by the product of the two estimates, (∫ f)² by that of the two halves. Infinite if p is
  /// zero where f is positive. nullopt if no light was found.
  std::optional<double> nev(const std::function<double(const Vec3&)>& pdf) const;

  std::span<const Sample> samples() const { return samples_; }

 private:
  std::vector<Sample> samples_;
};

/// Up to `count` nearest particles within maxDistance from which a record at the receiver would learn (normals within
/// 45°, light from the front).
std::vector<Particle> particlesAround(const Receiver& receiver, std::span<const Particle> particles, std::size_t count,
                                      float maxDistance);

/// The weighted mean Σ w log p / Σ w over the particles, with p a density over the area of the disc (twice that over
/// solid angle). nullopt if the weights are zero.
std::optional<double> meanLogDensity(std::span<const Particle> particles,
                                     const std::function<double(const Vec3&)>& pdf);

}  // namespace lobe
