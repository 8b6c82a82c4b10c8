#pragma once
// Gradient-domain path tracing for any guide (path_loop.h): a base path with its offset paths (shifted_path.h),
// emission and next-event estimation. The survival probability of the offset path, which is that of a base path at its
// place, is part of its density.

#include <array>
#include <optional>

#include "runtime/render/gradients/shifted_path.h"

namespace lobe {

/// The weights of the emission that paths find, against next-event estimation.
class EmissionWeights {
 public:
  static constexpr bool kWeighsRoulette = true;
  struct Step {
    LightSelection lights;
    Vec3 direction;
    float pdf;
  };

  explicit EmissionWeights(int shadowSurfaces) : shadowSurfaces_(shadowSurfaces) {}

  static void start(const Ray&, const SurfaceHit&) {}
  static void startOffset(std::size_t, const Ray&, const SurfaceHit&) {}
  static void arrive(const SurfaceHit&, int) {}
  static void arriveOffset(std::size_t, const SurfaceHit&, int) {}
  static Step step(const SurfaceHit&, const LightSelection& lights, const Vec3& direction, float pdf) {
    return {lights, direction, pdf};
  }
  void scatter(const Step& step) { base.scattered(step.lights, step.direction, step.pdf); }
  void scatterOffset(std::size_t i, const Step& step) { offsets[i].scattered(step.lights, step.direction, step.pdf); }
  void scatterDelta(const SurfaceHit& hit, const DeltaSample& sample) { base.passed(hit, sample.wi, shadowSurfaces_); }
  void scatterDeltaOffset(std::size_t i, const SurfaceHit& hit, const DeltaSample& sample) {
    offsets[i].passed(hit, sample.wi, shadowSurfaces_);
  }
  static void copied(std::size_t) {}

  EmissionWeight base;
  std::array<EmissionWeight, kNeighbours.size()> offsets;

 private:
  int shadowSurfaces_;
};

template <class Guide>
class GradientPath {
 public:
  GradientPath(const GradientContext<Guide>& context, Sampler& rng, PathStatistics& statistics)
      : scene_(context.scene),
        options_(context.options),
        guide_(context.guide),
        rng_(rng),
        statistics_(statistics),
        paths_(context, EmissionWeights(context.scene.shadowSurfaces), rng, statistics) {}

  /// Traces a base path through a random point of the pixel, with its offset paths.
  GradientSample trace(int x, int y) {
    ++statistics_.paths;
    if (options_.maxDepth < 1) return result_;
    paths_.start(x, y);
    while (arrive() && scatter()) {
    }
    return result_;
  }

 private:
  using Paths = ShiftedPath<Guide, EmissionWeights>;
  using Scattering = typename Paths::Scattering;
  using OffsetScattering = typename Paths::OffsetScattering;
  using OffsetScatterings = typename Paths::OffsetScatterings;

  // Adds emission where the path has arrived; returns false if it ends there.
  bool arrive() {
    if (paths_.depth > 1)
      addEmission();
    else if (options_.emitterVisibility == EmitterVisibility::shown)
      addVisible();
    return paths_.arrive();
  }

  void addVisible() {
    const Rgb radiance = emitted();
    result_.visible += radiance;
    statistics_.largest.add(luminance(radiance), {Technique::emission, paths_.depth, false});
  }

  // Adds the weighted contribution of the base path.
  void add(const Contribution& base, const PathKind& kind) {
    const Rgb value = base.weighted();
    result_.radiance += value;
    statistics_.largest.add(luminance(value), kind);
  }

  Rgb emitted() const {
    return paths_.hit ? emittedRadiance(*paths_.hit) : scene_.lights.environmentRadiance(paths_.direction);
  }

  void addEmission() {
    const Rgb radiance = emitted();
    if (!(radiance.maxCoeff() > 0.0f)) return;
    const Contribution base(paths_.throughput * radiance, 1.0, total(paths_.weights.base, paths_.hit));
    add(base, {Technique::emission, paths_.depth, paths_.byDelta});
    for (std::size_t i = 0; i < paths_.offsets.size(); ++i)
      result_.differences[i] +=
          weightedDifference(base, emissionOf(i), paths_.offsets[i].state != OffsetPath::State::apart);
  }

  // The sum of the squared densities of both techniques relative to that of finding the emission. It may be very large
  // for an offset path, whose weight is then that of the other technique.
  static double total(const EmissionWeight& weight, const std::optional<SurfaceHit>& hit) {
    return hit ? weight.inverseOfSurface(*hit) : weight.inverseOfEnvironment();
  }

  std::optional<Contribution> emissionOf(std::size_t i) const {
    const OffsetPath& offset = paths_.offsets[i];
    if (!offset.exists()) return std::nullopt;
    const std::optional<SurfaceHit>& hit = offset.isSeparate() ? offset.hit : paths_.hit;
    const Vec3& direction = offset.state == OffsetPath::State::apart ? offset.direction : paths_.direction;
    const Rgb radiance = hit ? emittedRadiance(*hit) : scene_.lights.environmentRadiance(direction);
    const double own2 = squared(offset.ratio);
    return Contribution(offset.throughput * radiance, own2, own2 * total(paths_.weights.offsets[i], hit));
  }

  // Returns false if the path ends.
  bool scatter() {
    if (!paths_.survives()) return false;
    const SurfaceHit hit = *paths_.hit;
    const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    if (delta >= 1.0f) return paths_.scatterDelta(hit, delta);
    const typename Guide::Vertex vertex(guide_, hit);
    const Scattering at{hit, vertex, scene_.lights.at(hit), delta};
    OffsetScatterings offsets;
    paths_.prepare(offsets);
    addDirectLight(at, offsets);
    if (delta > 0.0f && rng_.uniform() < delta) return paths_.scatterDelta(hit, delta);
    return paths_.scatterSmooth(at, offsets);
  }

  // Next-event estimation.
  void addDirectLight(const Scattering& at, const OffsetScatterings& offsets) {
    const double choice = rng_.stratifiedDouble();
    const std::optional<LightSample> light = at.lights.sample(choice, rng_.stratified2());
    if (!light) return;
    const Vec3 wi = at.hit.frame.toLocal(light->wi);
    if (!sidesAgree(at.hit, light->wi, wi)) return;
    const Rgb f = evalBsdf(at.hit, wi);
    if (!(f.maxCoeff() > 0.0f)) return;
    const ArrivingLight arriving = arrivingAt(at.hit, *light);
    if (!(arriving.radiance.maxCoeff() > 0.0f)) return;
    const Direct direct{*light, wi, f, arriving, f * arriving.radiance * (std::abs(wi.z()) / light->pdf)};
    const float pdf = light->delta ? 0.0f : (1.0f - at.delta) * at.vertex.pdf(wi);
    const Contribution base(paths_.throughput * direct.scattered, 1.0f, 1.0f + squared(pdf / light->pdf));
    add(base, {Technique::nextEvent, paths_.depth + arriving.rays, arriving.rays > 1});
    for (std::size_t i = 0; i < paths_.offsets.size(); ++i) {
      bool sameShift = true;
      const std::optional<Contribution> offset =
          directLight(at, direct, base, paths_.offsets[i], offsets[i], sameShift);
      result_.differences[i] += weightedDifference(base, offset, sameShift);
    }
  }

  // A light sample at the base path's vertex.
  struct Direct {
    const LightSample& light;
    Vec3 wi;
    Rgb f;
    const ArrivingLight& arriving;
    Rgb scattered;  // light over the density of the sample
  };

  ArrivingLight arrivingAt(const SurfacePoint& point, const LightSample& light) {
    ArrivingLight result = scene_.arriving(point, light, options_.maxDepth - paths_.depth - 1);
    statistics_.shadowRays += static_cast<std::uint64_t>(result.rays);
    return result;
  }

  std::optional<Contribution> directLight(const Scattering& at, const Direct& direct, const Contribution& base,
                                          const OffsetPath& offset, const std::optional<OffsetScattering>& scattering,
                                          bool& sameShift) {
    if (offset.state == OffsetPath::State::merged) {
      const double ratio2 = squared(offset.ratio);
      return Contribution(offset.throughput * direct.scattered, ratio2, ratio2 * base.total2);
    }
    if (!offset.exists() || !scattering) return std::nullopt;
    if (offset.state == OffsetPath::State::apart) return directLightApart(at, direct, offset, *scattering, sameShift);
    const SurfaceHit& hit = *offset.hit;
    const Vec3 wi = hit.frame.toLocal(direct.light.wi);
    if (!sidesAgree(hit, direct.light.wi, wi)) return std::nullopt;
    const Rgb f = evalBsdf(hit, wi);
    const float pdf = direct.light.delta ? 0.0f : scattering->smooth * scattering->vertex.pdf(wi);
    const Rgb value = offset.throughput * f * direct.arriving.radiance * (std::abs(wi.z()) / direct.light.pdf);
    return Contribution(value, squared(offset.ratio), squared(offset.ratio) * (1.0f + squared(pdf / direct.light.pdf)));
  }

  // The offset path has a vertex of its own, which is connected to the same point on the light.
  std::optional<Contribution> directLightApart(const Scattering& at, const Direct& direct, const OffsetPath& offset,
                                               const OffsetScattering& scattering, bool& sameShift) {
    const SurfaceHit& hit = *offset.hit;
    const std::optional<LightSample> light = scattering.lights.same(direct.light);
    if (!light) return std::nullopt;
    const Vec3 wi = hit.frame.toLocal(light->wi);
    if (!sidesAgree(hit, light->wi, wi)) return std::nullopt;
    const Rgb f = evalBsdf(hit, wi);
    if (!(f.maxCoeff() > 0.0f)) return std::nullopt;
    const ArrivingLight arriving = arrivingAt(hit, *light);
    const float scale = lightJacobian(direct.light, *light) / direct.light.pdf;
    const float own = offset.ratio * scale * light->pdf;
    const float other = light->delta ? 0.0f : offset.ratio * scale * scattering.smooth * scattering.vertex.pdf(wi);
    // Directional sampling finds the light directly, and its shift connects.
    sameShift = !light->delta && direct.arriving.rays == 1 && arriving.rays == 1 &&
                correspond(at.hit, direct.wi, hit, wi) && scattersBroadly(at.hit, direct.f) && scattersBroadly(hit, f);
    return Contribution(offset.throughput * f * arriving.radiance * (std::abs(wi.z()) * scale), squared(own),
                        squared(own) + squared(other));
  }

  static float lightJacobian(const LightSample& base, const LightSample& offset) {
    if (base.delta || !base.source) return 1.0f;
    return connectionJacobian(base.source->normal, base.wi * base.distance, offset.wi * offset.distance);
  }

  const RenderScene& scene_;
  const PathOptions& options_;
  const Guide& guide_;
  Sampler& rng_;
  PathStatistics& statistics_;
  GradientSample result_;
  Paths paths_;
};

}  // namespace lobe
