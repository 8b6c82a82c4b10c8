#pragma once
// A base path from the camera with its offset paths through the neighbouring pixels (offset_path.h), for any guide
// (path_loop.h). Each of their vertices is handled together. The base path is that of the path loop without splitting;
// Russian roulette is by throughput.
//
// Multiple importance weights are kept up to date along the paths by a type
//
//   class Weights {
//     struct Step;                                 // scattering by a non-delta component
//     static constexpr bool kWeighsRoulette;       // whether densities contain the probability of survival
//     void start(const Ray& ray, const SurfaceHit& hit);                    // the camera ray of the base path
//     void startOffset(std::size_t i, const Ray& ray, const SurfaceHit& hit);  // and of offset path i
//     void arrive(const SurfaceHit& hit, int depth);                           // at a vertex that scatters
//     void arriveOffset(std::size_t i, const SurfaceHit& hit, int depth);
//     // lights: next-event estimation at the vertex; direction: world space; pdf: over solid angle.
//     Step step(const SurfaceHit& hit, const LightSelection& lights, const Vec3& direction, float pdf) const;
//     void scatter(const Step& step);
//     void scatterOffset(std::size_t i, const Step& step);
//     void scatterDelta(const SurfaceHit& hit, const DeltaSample& sample);
//     void scatterDeltaOffset(std::size_t i, const SurfaceHit& hit, const DeltaSample& sample);
//     void copied(std::size_t i);  // offset path i has copied a half vector or a delta component
//   };

#include <algorithm>
#include <array>
#include <optional>

#include "runtime/render/film/camera.h"
#include "runtime/render/gradients/gradient_film.h"
#include "runtime/render/gradients/half_vector.h"
#include "runtime/render/gradients/offset_path.h"
#include "runtime/render/integrators/path_loop.h"

namespace lobe {

/// What is needed to trace paths. All objects must outlive it.
template <class Guide>
struct GradientContext {
  const RenderScene& scene;
  const RayCamera& camera;
  const PathOptions& options;
  const Guide& guide;
};
// clang 14, on which clang-tidy is based, does not deduce the arguments of aggregates.
template <class Guide>
GradientContext(const RenderScene&, const RayCamera&, const PathOptions&, const Guide&) -> GradientContext<Guide>;

template <class Guide, class Weights>
class ShiftedPath {
 public:
  using Vertex = typename Guide::Vertex;

  /// A vertex at which the base path may scatter by the non-delta component, with probability 1 − delta.
  struct Scattering {
    const SurfaceHit& hit;
    const Vertex& vertex;
    const LightSelection lights;
    float delta;
  };
  /// The same for an offset path that is separate.
  struct OffsetScattering {
    OffsetScattering(const Guide& guide, const SurfaceHit& hit, const Lights& all, float delta)
        : vertex(guide, hit), lights(all.at(hit)), smooth(1.0f - delta) {}
    Vertex vertex;
    LightSelection lights;
    float smooth;
  };
  using OffsetScatterings = std::array<std::optional<OffsetScattering>, kNeighbours.size()>;

  ShiftedPath(const GradientContext<Guide>& context, Weights weightsOfPaths, Sampler& rng, PathStatistics& statistics)
      : weights(std::move(weightsOfPaths)),
        scene_(context.scene),
        camera_(context.camera),
        options_(context.options),
        guide_(context.guide),
        rng_(rng),
        statistics_(statistics) {}

  /// Starts a base path through a random point of the pixel, and its offset paths.
  void start(int x, int y) {
    const CameraSample sample = camera_.sample(rng_);
    const Ray ray = camera_.rayThrough(x, y, sample);
    direction = ray.direction;
    hit = scene_.firstVisible(ray, options_.emitterVisibility, statistics_.segments);
    if (hit) weights.start(ray, *hit);
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      const int nextX = x + kNeighbours[i][0], nextY = y + kNeighbours[i][1];
      if (nextX < 0 || nextY < 0 || nextX >= camera_.width() || nextY >= camera_.height()) continue;
      const Ray shifted = camera_.rayThrough(nextX, nextY, sample);
      continueApart(offsets[i], shifted.direction,
                    scene_.firstVisible(shifted, options_.emitterVisibility, statistics_.segments));
      if (offsets[i].exists() && offsets[i].hit) weights.startOffset(i, shifted, *offsets[i].hit);
    }
    depth = 1;
  }

  /// Returns false if the base path ends where it has arrived.
  bool arrive() {
    if (!hit || !hit->bsdf || depth >= options_.maxDepth || !sidesAgree(*hit, hit->woWorld, hit->wo)) return false;
    weights.arrive(*hit, depth);
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      OffsetPath& offset = offsets[i];
      if (offset.isSeparate() && !arrivesAlike(*hit, *offset.hit, offset.state)) offset.fail();
      if (offset.exists()) weights.arriveOffset(i, offset.isSeparate() ? *offset.hit : *hit, depth);
    }
    return true;
  }

  /// Whether an offset path that arrives at a vertex can be scattered there as the base path is.
  static bool arrivesAlike(const SurfaceHit& base, const SurfaceHit& offset, OffsetPath::State state) {
    if (!offset.bsdf || !sidesAgree(offset, offset.woWorld, offset.wo)) return false;
    return state != OffsetPath::State::connected || offset.wo.z() * base.wo.z() > 0.0f;
  }

  /// The scattering of those offset paths that are separate, as far as they have a non-delta component.
  void prepare(OffsetScatterings& scatterings) const {
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      if (!offsets[i].isSeparate()) continue;
      const SurfaceHit& at = *offsets[i].hit;
      const float delta = at.bsdf->deltaProbability(at.wo, at.uv);
      if (delta < 1.0f) scatterings[i].emplace(guide_, at, scene_.lights, delta);
    }
  }

  /// Russian roulette as in the path loop; returns false if the path ends.
  bool survives() {
    if (depth < options_.rouletteDepth) return true;
    const float survival = survivalOf(throughput, eta2_, expected_);
    if (rng_.uniform() >= survival) return false;
    throughput /= survival;
    for (OffsetPath& offset : offsets)
      if (offset.exists())
        offset.scale(grey(1.0f / survival),
                     Weights::kWeighsRoulette
                         ? survivalOf(offset.throughput / offset.ratio, offset.eta2, offset.expected) / survival
                         : 1.0f);
    return true;
  }

  /// Scatters the paths by the non-delta component, and traces them to the next vertex; returns false if they end.
  bool scatterSmooth(const Scattering& at, const OffsetScatterings& scatterings) {
    byDelta = false;
    const std::optional<BsdfSample> sample = at.vertex.sample(rng_, statistics_);
    if (!sample) return false;
    const float pdf = (1.0f - at.delta) * sample->pdf;
    if (!continueAlong(at.hit, sample->wi, sample->f * (std::abs(sample->wi.z()) / pdf))) return false;
    eta2_ *= sample->eta * sample->eta;
    const Smooth smooth{at.hit, *sample, pdf, scattersBroadly(at.hit, sample->f),
                        weights.step(at.hit, at.lights, direction, pdf)};
    weights.scatter(smooth.step);
    for (std::size_t i = 0; i < offsets.size(); ++i)
      if (offsets[i].exists()) shift(smooth, i, scatterings[i]);
    return true;
  }

  /// The same for delta components, which are sampled with the probability `fraction`.
  bool scatterDelta(const SurfaceHit& at, float fraction) {
    statistics_.countDelta();
    byDelta = true;
    const std::optional<DeltaSample> sample = sampleDelta(at, rng_.uniform());
    if (!sample) return false;
    weights.scatterDelta(at, *sample);
    if (!continueAlong(at, sample->wi, sample->weight / fraction)) return false;
    eta2_ *= sample->eta * sample->eta;
    for (std::size_t i = 0; i < offsets.size(); ++i)
      if (offsets[i].exists()) shiftDelta(at, *sample, fraction, i);
    return true;
  }

  std::optional<SurfaceHit> hit;  ///< where the base path has arrived; nullopt: it has left the scene
  Vec3 direction = Vec3::Zero();  ///< in which it has arrived
  int depth = 0;                  ///< segments up to there
  bool byDelta = false;           ///< the last scattering was by a delta component
  Rgb throughput = Rgb::Ones();
  std::array<OffsetPath, kNeighbours.size()> offsets;
  Weights weights;

 private:
  // The base path leaves a vertex in a direction that was sampled from the non-delta component, and has arrived at the
  // next vertex.
  struct Smooth {
    const SurfaceHit& hit;
    const BsdfSample& sample;
    float pdf;
    bool broad;
    typename Weights::Step step;
  };

  // The offset path has arrived at a vertex of its own, or left the scene, which the base path must have done, too.
  void continueApart(OffsetPath& offset, const Vec3& towards, const std::optional<SurfaceHit>& arrived) const {
    offset.state = arrived.has_value() == hit.has_value() ? OffsetPath::State::apart : OffsetPath::State::failed;
    offset.direction = towards;
    offset.hit = arrived;
  }

  static float survivalOf(const Rgb& throughput, float eta2, const Rgb& expected) {
    return std::min(std::max(throughput.maxCoeff() * eta2, expected.maxCoeff()), kMaxSurvival);
  }

  void shift(const Smooth& base, std::size_t i, const std::optional<OffsetScattering>& scattering) {
    OffsetPath& offset = offsets[i];
    if (offset.state == OffsetPath::State::merged) {
      offset.eta2 *= base.sample.eta * base.sample.eta;
      weights.scatterOffset(i, base.step);
      follow(base.hit, base.sample.f * (std::abs(base.sample.wi.z()) / base.pdf), 1.0f, offset);
    } else if (!scattering) {
      offset.fail();
    } else if (offset.state == OffsetPath::State::connected) {
      const SurfaceHit at = *offset.hit;
      const Vec3 wi = at.frame.toLocal(direction);
      if (leave(base, at, wi, direction, 1.0f, i, *scattering)) offset.state = OffsetPath::State::merged;
    } else if (base.broad && (!hit || connectable(*hit))) {
      connect(base, i, *scattering);
    } else {
      copy(base, i, *scattering);
    }
  }

  static void follow(const SurfaceHit& at, const Rgb& contribution, float density, OffsetPath& offset) {
    offset.expected *= at.bsdf->albedo(at.wo, at.uv);
    offset.scale(contribution, density);
  }

  // Offset path i leaves a vertex of its own in the direction wi (local). Returns false if it fails.
  bool leave(const Smooth& base, const SurfaceHit& at, const Vec3& wi, const Vec3& towards, float jacobian,
             std::size_t i, const OffsetScattering& scattering) {
    OffsetPath& offset = offsets[i];
    const Rgb f = evalBsdf(at, wi);
    const float pdf = scattering.smooth * scattering.vertex.pdf(wi);
    follow(at, f * (std::abs(wi.z()) * jacobian / base.pdf), pdf * jacobian / base.pdf, offset);
    if (!sidesAgree(at, towards, wi) || !correspond(base.hit, base.sample.wi, at, wi)) offset.fail();
    if (!offset.exists()) return false;
    offset.eta2 *= base.sample.eta * base.sample.eta;
    weights.scatterOffset(i, weights.step(at, scattering.lights, towards, pdf));
    return true;
  }

  void connect(const Smooth& base, std::size_t i, const OffsetScattering& scattering) {
    OffsetPath& offset = offsets[i];
    const SurfaceHit at = *offset.hit;
    Vec3 towards = direction;
    float jacobian = 1.0f;
    std::optional<SurfaceHit> seen;
    if (hit) {
      const Vec3 segment = hit->position - at.position;
      towards = segment.normalized();
      jacobian = connectionJacobian(hit->normal, hit->position - base.hit.position, segment);
      seen = asSeenFrom(scene_.scene, *hit, -towards);
      seen->distance = segment.norm();
      if (!connectable(*seen)) return offset.fail();
    }
    const Vec3 wi = at.frame.toLocal(towards);
    if (!scattersBroadly(at, evalBsdf(at, wi))) return offset.fail();
    if (!leave(base, at, wi, towards, jacobian, i, scattering)) return;
    ++statistics_.shadowRays;
    const bool clear = hit ? scene_.visible(at, *hit) : !scene_.tracer.occluded(spawnRay(at, towards));
    if (!clear) return offset.fail();
    offset.state = OffsetPath::State::connected;
    offset.hit = seen;
  }

  void copy(const Smooth& base, std::size_t i, const OffsetScattering& scattering) {
    OffsetPath& offset = offsets[i];
    const SurfaceHit at = *offset.hit;
    const std::optional<ShiftedDirection> shifted = copiedDirection(base, at);
    if (!shifted) return offset.fail();
    const Vec3& wi = shifted->wi;
    if (!leave(base, at, wi, at.frame.toWorld(wi).normalized(), shifted->jacobian, i, scattering)) return;
    weights.copied(i);
    traceApart(at, wi, offset);
    // Such a path would be shifted by a connection.
    if (offset.exists() && scattersBroadly(at, evalBsdf(at, wi)) && (!offset.hit || connectable(*offset.hit)))
      offset.fail();
  }

  // The smallest rotation that aligns the shading normals maps the half vector: tangents may differ much on
  // neighbouring triangles.
  static std::optional<ShiftedDirection> copiedDirection(const Smooth& base, const SurfaceHit& at) {
    const Frame& from = base.hit.frame;
    if (!(from.n.dot(at.frame.n) > 0.0f)) return std::nullopt;
    const auto rotation = Eigen::Quaternionf::FromTwoVectors(from.n, at.frame.n);
    const auto rotated = [&](const Vec3& local) -> Vec3 { return at.frame.toLocal(rotation * from.toWorld(local)); };
    return copyHalfVector(rotated(base.hit.wo), rotated(base.sample.wi), base.sample.eta, at.wo);
  }

  void shiftDelta(const SurfaceHit& base, const DeltaSample& sample, float fraction, std::size_t i) {
    OffsetPath& offset = offsets[i];
    if (offset.state == OffsetPath::State::merged) {
      offset.eta2 *= sample.eta * sample.eta;
      weights.scatterDeltaOffset(i, base, sample);
      return follow(base, sample.weight / fraction, 1.0f, offset);
    }
    const SurfaceHit at = *offset.hit;
    const std::optional<DeltaSample> same =
        offset.state == OffsetPath::State::apart ? sharedComponent(base, at, sample.component) : std::nullopt;
    if (!same || !correspondDelta(base, sample, at, *same)) return offset.fail();
    const float ofBase = fraction * sample.probability;
    follow(at, same->weight * (same->probability / ofBase),
           at.bsdf->deltaProbability(at.wo, at.uv) * same->probability / ofBase, offset);
    offset.eta2 *= same->eta * same->eta;
    weights.scatterDeltaOffset(i, at, *same);
    weights.copied(i);
    traceApart(at, same->wi, offset);
  }

  // The component at the offset vertex. Only if it is also found at the base vertex does the shift lead back.
  static std::optional<DeltaSample> sharedComponent(const SurfaceHit& base, const SurfaceHit& at, double component) {
    std::optional<DeltaSample> same = deltaComponent(at, component);
    if (same && !deltaComponent(base, component)) same.reset();
    return same;
  }

  static bool correspondDelta(const SurfaceHit& base, const DeltaSample& baseSample, const SurfaceHit& offset,
                              const DeltaSample& sample) {
    return (base.wo.z() * baseSample.wi.z() > 0.0f) == (offset.wo.z() * sample.wi.z() > 0.0f) &&
           (baseSample.eta == 1.0f) == (sample.eta == 1.0f);
  }

  // Traces the offset path to its next vertex in a direction that is local in at.frame.
  void traceApart(const SurfaceHit& at, const Vec3& wi, OffsetPath& offset) {
    const Vec3 towards = at.frame.toWorld(wi).normalized();
    if (!offset.exists() || !sidesAgree(at, towards, wi)) return offset.fail();
    ++statistics_.segments;
    continueApart(offset, towards, scene_.tracer.trace(spawnRay(at, towards)));
  }

  // Traces the base path to its next vertex; returns false if it ends.
  bool continueAlong(const SurfaceHit& at, const Vec3& wi, const Rgb& weight) {
    direction = at.frame.toWorld(wi).normalized();
    if (!sidesAgree(at, direction, wi)) return false;
    throughput *= weight;
    if (!(throughput.maxCoeff() > 0.0f)) return false;
    expected_ *= at.bsdf->albedo(at.wo, at.uv);
    ++statistics_.segments;
    ++depth;
    hit = scene_.tracer.trace(spawnRay(at, direction));
    return true;
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
  const PathOptions& options_;
  const Guide& guide_;
  Sampler& rng_;
  PathStatistics& statistics_;
  Rgb expected_ = Rgb::Ones();
  float eta2_ = 1;
};

}  // namespace lobe
