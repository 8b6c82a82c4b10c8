#pragma once
// Light tracing as a further technique of unidirectional path tracing: vertices of light paths are connected to the
// camera, and combined with the paths that end at a light by chance or by next-event estimation by multiple importance
// sampling (partial_weights.h without connections between subpaths). Light paths find caustics that camera paths rarely
// find.
//
// A PathLoop weights its camera paths by a type with a nested class Weight, which is kept up to date along a path:
//
//   struct LightPaths {
//     class Weight;
//     void arrive(Weight& weight, const Ray& ray, const SurfaceHit& hit, int depth) const;   // before it scatters
//     void scatter(Weight& weight, const SurfaceHit& hit, const Vec3& direction, float pdf) const;
//     void scatterDelta(Weight& weight, const SurfaceHit& hit, const Vec3& direction, float eta) const;
//     // The squared density of light tracing relative to that of the path: of emission that it has found on a
//     // surface, or in the environment along a ray, and of light that next-event estimation has found.
//     float atLight(const Weight& weight, const SurfaceHit& hit) const;
//     float atEnvironment(const Weight& weight, const Ray& ray) const;
//     float ofNextEvent(const Weight& weight, const SurfaceHit& hit, const LightSample& light,
//                       const ArrivingLight& arriving) const;
//   };

#include <optional>

#include "runtime/render/film/camera.h"
#include "runtime/render/integrators/partial_weights.h"
#include "runtime/render/lights/photon_emission.h"

namespace lobe {

/// The light paths of a sample of the image.
struct LightTracing {
  double pathsPerPixel;     ///< mean number, > 0
  PhotonEmission emission;  ///< where they start
};

/// The density with which a path of the guide (path_loop.h) that comes from the direction seen.wo continues in the
/// direction hit.wo. Both hits are the same point, seen from two directions.
template <class Guide>
float reversePdf(const Guide& guide, const SurfaceHit& seen, const SurfaceHit& hit) {
  if (!sidesAgree(seen, seen.woWorld, seen.wo)) return 0.0f;
  const float smooth = 1.0f - seen.bsdf->deltaProbability(seen.wo, seen.uv);
  if (smooth <= 0.0f) return 0.0f;
  return smooth * typename Guide::Vertex(guide, seen).pdf(seen.frame.toLocal(hit.woWorld));
}

/// No light paths.
struct NoLightPaths {
  struct Weight {};
  static void arrive(Weight&, const Ray&, const SurfaceHit&, int) {}
  static void scatter(Weight&, const SurfaceHit&, const Vec3&, float) {}
  static void scatterDelta(Weight&, const SurfaceHit&, const Vec3&, float) {}
  static float atLight(const Weight&, const SurfaceHit&) { return 0; }
  static float atEnvironment(const Weight&, const Ray&) { return 0; }
  static float ofNextEvent(const Weight&, const SurfaceHit&, const LightSample&, const ArrivingLight&) { return 0; }
};

/// Light paths whose directions a guide samples (BidirectionalPaths::traceLight).
template <class LightGuide>
class LightPaths {
 public:
  using Weight = std::optional<PartialWeights>;

  /// All references must outlive it.
  LightPaths(const RenderScene& scene, const RayCamera& camera, const LightGuide& guide, const LightTracing& tracing)
      : scene_(scene),
        camera_(camera),
        guide_(guide),
        emission_(tracing.emission),
        count_(tracing.pathsPerPixel * camera.width() * camera.height()) {}

  void arrive(Weight& weight, const Ray& ray, const SurfaceHit& hit, int depth) const {
    if (depth == 1) weight = PartialWeights::fromCamera(camera_.density(ray, hit.distance), count_, 0);
    weight->arrive(depth == 1 ? 1.0f : hit.distance, std::abs(hit.normal.dot(hit.woWorld)));
  }

  void scatter(Weight& weight, const SurfaceHit& hit, const Vec3& direction, float pdf) const {
    weight->scatter(pdf, reverse(*weight, hit, direction), std::abs(hit.normal.dot(direction)));
    weight->disconnect();
  }

  void scatterDelta(Weight& weight, const SurfaceHit& hit, const Vec3& direction, float eta) const {
    if (hit.bsdf->mapsNormals() && !sameFrame(hit, asSeenFrom(scene_.scene, hit, direction))) weight->exclude();
    weight->scatterDelta(std::abs(hit.normal.dot(hit.woWorld)), eta);
  }

  float atLight(const Weight& weight, const SurfaceHit& hit) const {
    if (!weight) return 0;
    return static_cast<float>(weight->atLight(0, emission_.density(hit), std::abs(hit.normal.dot(hit.woWorld))));
  }

  float atEnvironment(const Weight& weight, const Ray& ray) const {
    if (!weight) return 0;
    return static_cast<float>(weight->atLight(0, emission_.environmentDensity(ray.origin, ray.direction), 1));
  }

  float ofNextEvent(const Weight& weight, const SurfaceHit& hit, const LightSample& light,
                    const ArrivingLight& arriving) const {
    if (!arriving.reversible) return 0;
    const bool onSurface = light.source && !light.delta;
    const double cosineAtLight = onSurface ? std::abs(light.source->normal.dot(light.wi)) : 1.0f;
    // A point light has a density over solid angle in the sense of LightSelection::pdf.
    const double density =
        light.delta && light.source ? static_cast<double>(light.pdf) * squared(light.distance) : light.pdf;
    // Conserved on the way: n² dA cosθ dω.
    const double emission = emission_.density(light, arriving.last) * std::abs(hit.normal.dot(light.wi)) /
                            (cosineAtLight * squared(arriving.eta));
    if (!(emission > 0)) return 0;
    return static_cast<float>(squared(emission / density) * weight->sumOfOthers(reverse(*weight, hit, light.wi)));
  }

 private:
  /// The density with which light paths that arrive from a direction continue towards the camera, if it matters.
  float reverse(const PartialWeights& weight, const SurfaceHit& hit, const Vec3& direction) const {
    return weight.dependsOnReverse() ? reversePdf(guide_, asSeenFrom(scene_.scene, hit, direction), hit) : 0.0f;
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
  const LightGuide& guide_;
  PhotonEmission emission_;
  double count_;  // light paths of a sample of the image
};

}  // namespace lobe
