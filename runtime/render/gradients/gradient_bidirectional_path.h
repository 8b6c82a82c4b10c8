#pragma once
// Gradient-domain bidirectional path tracing (Manzi et al. 2015, "Gradient-Domain Bidirectional Path Tracing"): the
// techniques of bidirectional_paths.h with a base camera path and its offset paths (shifted_path.h). Both are connected
// to the same light path.
//
// The shift of a path is that of shifted_path.h, whichever technique has made it, as far as the technique can follow
// it: where the offset path is connected to the base path at a vertex of the camera path, or by the connection to a
// light vertex or to a point of a light. Light tracing shifts the first vertex to the neighbouring pixel, and connects
// it to the second. The techniques that follow the shift are combined for both paths of a pair. The others estimate the
// difference of their own part of the pixels:
//   - connections from a vertex where a path would copy the half vector, with an offset path that is connected to the
//     same light vertex;
//   - light tracing where the first vertex would copy its half vector, or the second is purely specular, without an
//     offset path: caustics are as noisy as without gradients.

#include <array>
#include <cmath>
#include <optional>

#include "runtime/render/gradients/bidirectional_weights.h"
#include "runtime/render/gradients/gradient_light_image.h"
#include "runtime/render/gradients/shifted_path.h"
#include "runtime/render/integrators/bidirectional_paths.h"

namespace lobe {

template <class CameraGuide, class LightGuide>
class GradientBidirectionalPath {
 public:
  /// All references must outlive it.
  GradientBidirectionalPath(const GradientContext<CameraGuide>& context, const LightGuide& lightGuide, Sampler& rng,
                            PathStatistics& statistics)
      : scene_(context.scene),
        camera_(context.camera),
        options_(context.options),
        guide_(context.guide),
        rng_(rng),
        statistics_(statistics),
        connector_(context.scene, context.camera, context.options, context.guide, lightGuide),
        paths_(context, Weights(context.scene, context.camera, lightGuide, connector_.lightPaths()), rng, statistics) {}

  /// Traces a light path, which lightRng determines, and a base path through a random point of the pixel with its
  /// offset paths.
  GradientSample trace(int x, int y, Sampler& lightRng, GradientSplats splats) {
    ++statistics_.paths;
    if (options_.maxDepth < 1) return result_;
    connector_.traceLightPath(lightRng, statistics_, light_);
    for (std::size_t i = 0; i < light_.vertices.size(); ++i) connectToCamera(i, splats);
    paths_.start(x, y);
    while (arrive() && scatter()) {
    }
    return result_;
  }

 private:
  using Connector = BidirectionalPaths<CameraGuide, LightGuide>;
  using LightVertex = typename Connector::LightVertex;
  using Connection = typename Connector::Connection;
  using LightConnection = typename Connector::LightConnection;
  using Weights = BidirectionalWeights<LightGuide>;
  using Paths = ShiftedPath<CameraGuide, Weights>;
  using Scattering = typename Paths::Scattering;
  using OffsetScattering = typename Paths::OffsetScattering;
  using OffsetScatterings = typename Paths::OffsetScatterings;
  using State = OffsetPath::State;
  using Pair = typename Weights::Pair;

  static float toFloat(double x) { return static_cast<float>(x); }

  // ---- Light tracing

  void connectToCamera(std::size_t i, GradientSplats splats) {
    const LightVertex& vertex = light_.vertices[i];
    const auto viewed = connector_.viewed(vertex, light_.lens, statistics_);
    if (!viewed) return;
    const double total = 1.0 + viewed->others;
    const Contribution base(viewed->value, total, total);
    const Vec2& film = viewed->view.film;
    GradientSample sample{base.weighted()};
    statistics_.largest.add(luminance(sample.radiance), {Technique::lightTracing, vertex.depth + 1, vertex.delta});
    for (std::size_t d = 0; d < kNeighbours.size(); ++d)
      sample.differences[d] =
          weightedDifference(base, shiftedToPixel(i, *viewed, film + Vec2(kNeighbours[d][0], kNeighbours[d][1])));
    splats.add(film, sample);
  }

  // The offset path of one of light tracing, through another point of the film.
  std::optional<Contribution> shiftedToPixel(std::size_t i, const typename Connector::ViewedVertex& viewed,
                                             const Vec2& film) {
    const LightVertex& vertex = light_.vertices[i];
    const Vec3& direction = vertex.hit.woWorld;
    if (vertex.arrivalPdf <= 0.0f || !scattersBroadlyTo(viewed.seen, direction)) return std::nullopt;
    const Ray ray = camera_.rayThrough(film, light_.lens);
    const std::optional<SurfaceHit> hit = scene_.firstVisible(ray, options_.emitterVisibility, statistics_.segments);
    if (!hit || !Paths::arrivesAlike(viewed.seen, *hit, State::apart)) return std::nullopt;
    const float delta = hit->bsdf->deltaProbability(hit->wo, hit->uv);
    if (delta >= 1.0f) return std::nullopt;
    const OffsetScattering scattering(guide_, *hit, scene_.lights, delta);
    const PartialWeights weights = paths_.weights.atFirstVertex(ray, *hit);
    return vertex.depth == 1 ? shiftedDirectLight(vertex, viewed, *hit, scattering, weights)
                             : shiftedConnection(vertex, light_.vertices[i - 1], viewed, *hit, scattering, weights);
  }

  std::optional<Contribution> shiftedConnection(const LightVertex& vertex, const LightVertex& previous,
                                                const typename Connector::ViewedVertex& viewed, const SurfaceHit& hit,
                                                const OffsetScattering& scattering, const PartialWeights& weights) {
    const auto found = connector_.connection(hit, scattering.vertex, scattering.smooth, previous, &statistics_);
    const SurfaceHit seen = asSeenFrom(scene_.scene, previous.hit, -vertex.hit.woWorld);
    if (!found || !connectsAlike(viewed.seen, seen, hit, found->seen, previous.hit.woWorld)) return std::nullopt;
    // The density of the connection over that of light tracing, for the base path.
    const float area = std::abs(vertex.hit.normal.dot(vertex.hit.woWorld)) / squaredDistance(vertex, previous);
    const double density = viewed.density / (connector_.lightPaths() * vertex.arrivalPdf * area);
    const double total = squared(density) * found->total(weights);
    return Contribution(found->value * toFloat(density / vertex.survival), total, total);
  }

  static float squaredDistance(const LightVertex& a, const LightVertex& b) {
    return (a.hit.position - b.hit.position).squaredNorm();
  }

  // The first vertex of the camera path sees the light.
  std::optional<Contribution> shiftedDirectLight(const LightVertex& vertex,
                                                 const typename Connector::ViewedVertex& viewed, const SurfaceHit& hit,
                                                 const OffsetScattering& scattering, const PartialWeights& weights) {
    const std::optional<LightSample> base = scene_.lights.at(viewed.seen).same(originOf(*light_.photon));
    const std::optional<LightSample> light = base ? scattering.lights.same(*base) : base;
    if (!light) return std::nullopt;
    const auto found = connector_.lightConnection(hit, scattering.vertex, scattering.smooth, *light, &statistics_);
    if (!found || !scattersAlike(viewed.seen, base->wi, hit, light->wi)) return std::nullopt;
    // One over the density of light tracing, for the base path, in units of that of the light sample.
    const double emission = connector_.emissionDensity(viewed.seen, *base);
    const double scale = lightJacobian(*base, *light) * viewed.density / (connector_.lightPaths() * emission);
    const double total = squared(scale) * found->total(weights);
    return Contribution(found->value * toFloat(scale / vertex.survival), total, total);
  }

  // What LightSelection::same uses of a light sample.
  LightSample originOf(const EmittedPhoton& photon) const {
    LightSample light{-photon.ray.direction, kInfinity, Rgb::Zero(), 0, std::nullopt, photon.delta, photon.light};
    if (photon.light < 0) light.radiance = scene_.lights.environmentRadiance(light.wi);
    if (photon.light < 0 || photon.delta) return light;
    light.radiance = photon.power * (photon.density / photon.cosine());
    light.source = SurfacePoint{photon.ray.origin, photon.normal, Vec2::Zero(), 0.0f};
    return light;
  }

  // ---- Camera paths

  // Adds emission where the path has arrived; returns false if it ends there.
  bool arrive() {
    if (paths_.depth > 1)
      addEmission();
    else if (options_.emitterVisibility == EmitterVisibility::shown)
      addVisible();
    return paths_.arrive();
  }

  void addVisible() {
    const Rgb radiance = emitted(paths_.hit, paths_.direction);
    result_.visible += radiance;
    statistics_.largest.add(luminance(radiance), {Technique::emission, paths_.depth, false});
  }

  // Adds the weighted contribution of the base path.
  void add(const Contribution& base, const PathKind& kind) {
    const Rgb value = base.weighted();
    result_.radiance += value;
    statistics_.largest.add(luminance(value), kind);
  }

  void addEmission() {
    const Rgb radiance = emitted(paths_.hit, paths_.direction);
    if (!(radiance.maxCoeff() > 0.0f)) return;
    const auto& weights = paths_.weights;
    Contribution base(paths_.throughput * radiance, 1.0,
                      totalOfEmission(weights.base.all, weights.base.nextEvent, paths_.hit, paths_.direction));
    add(base, {Technique::emission, paths_.depth, paths_.byDelta});
    for (std::size_t i = 0; i < paths_.offsets.size(); ++i) {
      const OffsetPath& offset = paths_.offsets[i];
      std::optional<Contribution> shifted;
      if (offset.exists()) {
        const std::optional<SurfaceHit>& hit = offset.isSeparate() ? offset.hit : paths_.hit;
        const Vec3& direction = offset.state == State::apart ? offset.direction : paths_.direction;
        const std::optional<LightSelection>& nextEvent = weights.offsets[i].nextEvent;
        const double own2 = squared(offset.ratio);
        base.group2 = totalOfEmission(weights.pairs[i].baseGroup, weights.base.nextEvent, paths_.hit, paths_.direction);
        shifted.emplace(offset.throughput * emitted(hit, direction),
                        own2 * totalOfEmission(weights.pairs[i].group, nextEvent, hit, direction),
                        own2 * totalOfEmission(weights.offsets[i].all, nextEvent, hit, direction));
      }
      result_.differences[i] += weightedDifference(base, shifted);
    }
  }

  Rgb emitted(const std::optional<SurfaceHit>& hit, const Vec3& direction) const {
    return hit ? emittedRadiance(*hit) : scene_.lights.environmentRadiance(direction);
  }

  // The sum of the squared densities of the techniques that `weights` includes, relative to that of finding the
  // emission.
  double totalOfEmission(const PartialWeights& weights, const std::optional<LightSelection>& nextEvent,
                         const std::optional<SurfaceHit>& hit, const Vec3& direction) const {
    const Lights& lights = scene_.lights;
    if (!hit)
      return 1.0 + weights.atLight(nextEvent ? nextEvent->environmentPdf(direction) : 0.0f,
                                   lights.environmentPhotonDensity(direction), 1.0f);
    return 1.0 + weights.atLight(nextEvent ? nextEvent->pdf(*hit) : 0.0f, lights.photonDensity(*hit),
                                 std::abs(hit->normal.dot(hit->woWorld)));
  }

  // Returns false if the path ends.
  bool scatter() {
    if (!paths_.survives()) return false;
    const SurfaceHit hit = *paths_.hit;
    const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    if (delta >= 1.0f) return paths_.scatterDelta(hit, delta);
    const typename CameraGuide::Vertex vertex(guide_, hit);
    const Scattering at{hit, vertex, scene_.lights.at(hit), delta};
    OffsetScatterings offsets;
    paths_.prepare(offsets);
    addDirectLight(at, offsets);
    for (const LightVertex& light : light_.vertices) {
      if (paths_.depth + light.depth >= options_.maxDepth) break;
      connect(at, offsets, light);
    }
    if (delta > 0.0f && rng_.uniform() < delta) return paths_.scatterDelta(hit, delta);
    return paths_.scatterSmooth(at, offsets);
  }

  // Adds a connection of the base path, and its differences from those of the offset paths. Both have a function
  // `total` of PartialWeights. scale: one over the density of the connection. offsetOf(i, scattering): that of offset
  // path i, if it has a vertex of its own, relative to the base path.
  template <class AnyConnection, class OffsetOf>
  void add(const AnyConnection& connection, const PathKind& kind, double scale, const OffsetScatterings& scatterings,
           const OffsetOf& offsetOf) {
    const auto& weights = paths_.weights;
    const double scale2 = squared(scale);
    Contribution base(paths_.throughput * connection.value * toFloat(scale), 1.0,
                      scale2 * connection.total(weights.base.all));
    add(base, kind);
    for (std::size_t i = 0; i < paths_.offsets.size(); ++i) {
      const OffsetPath& offset = paths_.offsets[i];
      std::optional<Contribution> shifted;
      bool alike = true;
      if (offset.state == State::merged) {
        const double ratio2 = squared(offset.ratio) * scale2;
        shifted.emplace(offset.throughput * connection.value * toFloat(scale),
                        ratio2 * connection.total(weights.pairs[i].group),
                        ratio2 * connection.total(weights.offsets[i].all));
      } else if (offset.exists() && scatterings[i]) {
        shifted = offsetOf(i, *scatterings[i], alike);
      }
      base.group2 = alike ? scale2 * connection.total(weights.pairs[i].baseGroup) : 1.0;
      result_.differences[i] += weightedDifference(base, shifted);
    }
  }

  // The connection of offset path i with a vertex of its own. scale: one over the density of the base path's, times the
  // Jacobian; own: the density.
  template <class AnyConnection>
  Contribution offsetContribution(std::size_t i, const AnyConnection& connection, double scale, double own,
                                  bool alike) const {
    const OffsetPath& offset = paths_.offsets[i];
    const double ratio2 = squared(offset.ratio * scale);
    return {offset.throughput * connection.value * toFloat(scale),
            ratio2 * (alike ? connection.total(paths_.weights.pairs[i].group) : squared(own)),
            ratio2 * connection.total(paths_.weights.offsets[i].all)};
  }

  void connect(const Scattering& at, const OffsetScatterings& scatterings, const LightVertex& light) {
    const auto base = connector_.connection(at.hit, at.vertex, 1.0f - at.delta, light, &statistics_);
    if (!base) return;
    const Vec3 baseDirection = light.hit.position - at.hit.position;
    add(*base, {Technique::connection, paths_.depth + light.depth + 1, light.delta}, 1.0, scatterings,
        [&](std::size_t i, const OffsetScattering& scattering, bool& alike) -> std::optional<Contribution> {
          const OffsetPath& offset = paths_.offsets[i];
          const bool apart = offset.state == State::apart;
          const auto found = connector_.connection(*offset.hit, scattering.vertex, scattering.smooth, light,
                                                   apart ? &statistics_ : nullptr);
          if (!found) return std::nullopt;
          const Vec3 direction = light.hit.position - offset.hit->position;
          alike = apart ? scattersBroadlyTo(at.hit, baseDirection.normalized()) &&
                              connectsAlike(at.hit, base->seen, *offset.hit, found->seen, light.hit.woWorld)
                        : correspond(at.hit, at.hit.frame.toLocal(baseDirection), *offset.hit,
                                     offset.hit->frame.toLocal(direction));
          return offsetContribution(i, *found, 1.0, 1.0, alike);
        });
  }

  // Next-event estimation.
  void addDirectLight(const Scattering& at, const OffsetScatterings& scatterings) {
    const double choice = rng_.stratifiedDouble();
    const std::optional<LightSample> light = at.lights.sample(choice, rng_.stratified2());
    if (!light) return;
    const auto base = connector_.lightConnection(at.hit, at.vertex, 1.0f - at.delta, *light, &statistics_);
    if (!base) return;
    add(*base, {Technique::nextEvent, paths_.depth + 1, false}, 1.0 / base->density, scatterings,
        [&](std::size_t i, const OffsetScattering& scattering, bool& alike) -> std::optional<Contribution> {
          const OffsetPath& offset = paths_.offsets[i];
          const bool apart = offset.state == State::apart;
          const std::optional<LightSample> same = apart ? scattering.lights.same(*light) : light;
          if (!same) return std::nullopt;
          const auto found = connector_.lightConnection(*offset.hit, scattering.vertex, scattering.smooth, *same,
                                                        apart ? &statistics_ : nullptr);
          if (!found) return std::nullopt;
          alike = apart ? scattersAlike(at.hit, light->wi, *offset.hit, same->wi)
                        : correspond(at.hit, base->wi, *offset.hit, found->wi);
          return offsetContribution(i, *found, lightJacobian(*light, *same) / base->density, found->density, alike);
        });
  }

  // ---- The conditions of the shift

  static bool scattersBroadlyTo(const SurfaceHit& hit, const Vec3& direction) {
    return scattersBroadly(hit, evalBsdf(hit, hit.frame.toLocal(direction)));
  }

  // Whether base and offset path are connected in these directions (world space), rather than copying a half vector.
  static bool scattersAlike(const SurfaceHit& base, const Vec3& baseDirection, const SurfaceHit& offset,
                            const Vec3& direction) {
    return scattersBroadlyTo(base, baseDirection) && scattersBroadlyTo(offset, direction) &&
           correspond(base, base.frame.toLocal(baseDirection), offset, offset.frame.toLocal(direction));
  }

  // The same for a connection to one vertex, which both see, `seen` and `offsetSeen`, and from which a direction leads
  // on.
  static bool connectsAlike(const SurfaceHit& base, const SurfaceHit& seen, const SurfaceHit& offset,
                            const SurfaceHit& offsetSeen, const Vec3& onwards) {
    return scattersAlike(base, -seen.woWorld, offset, -offsetSeen.woWorld) && connectable(seen) &&
           connectable(offsetSeen) && Paths::arrivesAlike(seen, offsetSeen, State::connected) &&
           correspond(seen, seen.frame.toLocal(onwards), offsetSeen, offsetSeen.frame.toLocal(onwards));
  }

  // Of the density of next-event estimation at two vertices that see the same point of a light, as
  // LightConnection::density.
  static double lightJacobian(const LightSample& base, const LightSample& offset) {
    if (!base.source) return 1.0;
    if (base.delta) return squared(base.distance / offset.distance);
    return connectionJacobian(base.source->normal, base.wi * base.distance, offset.wi * offset.distance);
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
  const PathOptions& options_;
  const CameraGuide& guide_;
  Sampler& rng_;
  PathStatistics& statistics_;
  GradientSample result_;
  Connector connector_;
  typename Connector::LightPath light_;
  Paths paths_;
};

}  // namespace lobe
