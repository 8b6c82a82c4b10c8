#pragma once
// A scene with its ray tracer and lights, and next-event estimation through surfaces that transmit light without
// scattering it (panes, masks, refracting interfaces).

#include "runtime/render/geometry/raytracer.h"
#include "runtime/render/lights/lights.h"

namespace lobe {

/// Where a ray ends after it has passed surfaces by delta transmission.
struct TransmittedRay {
  Ray last;                       ///< its last segment, with a unit direction
  std::optional<SurfaceHit> hit;  ///< at the end of the last segment; nullopt: the ray left the scene or reached tfar
  Rgb transmittance = Rgb::Ones();
  int surfaces = 0;   ///< passed
  bool bent = false;  ///< at least one surface changed the direction
  float eta = 1;      ///< index of refraction at its end over that at its origin
  /// Whether light takes the same way in the other direction. It does not where a mapped normal depends on the viewer.
  bool reversible = true;
};

/// Light that reaches a point from a light sample.
struct ArrivingLight {
  Rgb radiance = Rgb::Zero();  ///< for a delta light, its irradiance; zero if the light is blocked
  Ray last;                    ///< the last segment of the way to the light; unit direction
  int rays = 1;                ///< traced
  float eta = 1;               ///< as in TransmittedRay
  bool reversible = true;      ///< as in TransmittedRay
};

struct RenderScene {
  static constexpr int kDefaultShadowSurfaces = 16;

  /// The scene must outlive it. shadowSurfaces: maximum number of surfaces that next-event estimation passes by delta
  /// transmission, ≥ 0.
  explicit RenderScene(const Scene& s, int shadowSurfaces = kDefaultShadowSurfaces);

  /// Follows a ray (unit direction) through up to maxSurfaces surfaces, at each by Bsdf::deltaTransmission. A ray with
  /// a finite tfar ends at `target`, which it must point to, and at the first surface that would change its direction.
  TransmittedRay follow(Ray ray, int maxSurfaces, const Vec3* target = nullptr) const;

  /// The light of a sample that arrives at `from.position` from light.wi. It passes up to min(shadowSurfaces,
  /// maxSurfaces) surfaces by delta transmission. Light from the environment may be refracted, and has the radiance of
  /// the direction in which the ray leaves the scene; light from other emitters passes only where its direction stays
  /// the same.
  ArrivingLight arriving(const SurfacePoint& from, const LightSample& light, int maxSurfaces) const;

  /// Whether a light sample taken at `from.position` is unoccluded; surfaces that transmit light occlude, too.
  bool visible(const SurfacePoint& from, const LightSample& light) const;
  /// Whether nothing is between two points of surfaces.
  bool visible(const SurfacePoint& from, const SurfacePoint& to) const;

  /// The first surface that the camera sees along one of its rays. `rays` is increased by the number of rays traced;
  /// the distance of the hit is from the origin of `ray`, also behind emitters that are hidden.
  std::optional<SurfaceHit> firstVisible(Ray ray, EmitterVisibility visibility, std::uint64_t& rays) const;
  /// The same with the visibility that the scene has, without a count.
  std::optional<SurfaceHit> firstVisible(const Ray& ray) const;
  /// Whether the camera sees the point of a surface at the end of its ray.
  bool visibleToCamera(const SurfaceHit& point, const Ray& ray, EmitterVisibility visibility) const;

  const Scene& scene;
  RayTracer tracer;
  Lights lights;
  int shadowSurfaces;  ///< 0 if no material of the scene transmits light
};

/// Multiple importance weight of a technique with density `own` against one with density `other` (power heuristic).
/// others: the sum over further techniques of their squared densities relative to `own`.
inline float misWeight(float own, float other, float others = 0) {
  const float ratio = other / own;
  return 1.0f / (1.0f + ratio * ratio + others);
}

/// The transmission that next-event estimation follows at a surface, if a path that continues in the direction wi
/// (local in hit.frame) by a delta component follows it, too. nullopt: the path takes another way.
std::optional<DeltaTransmission> sharedTransmission(const SurfaceHit& hit, const Vec3& wi);

/// How light has come from its source to a surface, which decides whether next-event estimation finds the same way.
struct LightPassage {
  bool specular = true;  ///< it has met delta components only
  bool followed = true;  ///< and next-event estimation would follow the same way
  bool bent = false;     ///< at least one surface changed the direction
  int surfaces = 0;      ///< passed
  float distance = 0;    ///< from the light, up to the last surface

  /// The light is scattered at a hit by a non-delta component.
  void scatter() { specular = false; }
  /// It continues by a delta component, in a direction that is local in hit.frame.
  void pass(const SurfaceHit& hit, const Vec3& wi, int shadowSurfaces);
  /// Whether next-event estimation at the next surface finds this way. Along a direction that refraction has changed it
  /// finds the environment only, no light at a finite distance and no directional light.
  bool found(bool fromEnvironment) const { return specular && followed && (fromEnvironment || !bent); }
};

/// The multiple importance weight of the emission that a path finds, against next-event estimation at the last vertex
/// that scattered the path: there, next-event estimation samples the same direction, and follows the same delta
/// transmissions.
class EmissionWeight {
 public:
  /// The path was scattered into a direction (world space) with a density over solid angle, at a vertex with this
  /// next-event estimation.
  void scattered(const LightSelection& nextEvent, const Vec3& direction, float pdf) {
    nextEvent_ = nextEvent;
    direction_ = direction;
    pdf_ = pdf;
    surfaces_ = 0;
    bent_ = false;
  }
  /// The path continued by a delta component, in a direction that is local in hit.frame.
  void passed(const SurfaceHit& hit, const Vec3& wi, int shadowSurfaces);

  /// others: as for misWeight.
  float ofEnvironment(float others = 0) const {
    return pdf_ > 0 ? misWeight(pdf_, nextEvent_.environmentPdf(direction_), others) : 1.0f / (1.0f + others);
  }
  /// hit: on an area light.
  float ofSurface(const SurfaceHit& hit, float others = 0) const {
    return pdf_ > 0 && !bent_ ? misWeight(pdf_, nextEvent_.pdf(hit), others) : 1.0f / (1.0f + others);
  }
  /// One over the weight, without other techniques, in double precision: finite where the weight is zero to rounding.
  double inverseOfEnvironment() const { return pdf_ > 0 ? inverse(nextEvent_.environmentPdf(direction_)) : 1.0; }
  double inverseOfSurface(const SurfaceHit& hit) const {
    return pdf_ > 0 && !bent_ ? inverse(nextEvent_.pdf(hit)) : 1.0;
  }

 private:
  double inverse(double other) const { return 1.0 + (other / pdf_) * (other / pdf_); }

  LightSelection nextEvent_;
  Vec3 direction_ = Vec3::Zero();
  float pdf_ = 0;  // 0: next-event estimation does not find the emission
  int surfaces_ = 0;
  bool bent_ = false;
};

}  // namespace lobe
