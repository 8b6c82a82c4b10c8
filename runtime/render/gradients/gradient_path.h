#pragma once
// Gradient-domain path tracing for any guide (path_loop.h): a base path through a pixel and its offset paths through
// the neighbouring pixels (offset_path.h), each vertex of which is handled together. The base path is that of the path
// loop without splitting. Russian roulette is by throughput: the survival probability of the offset path, which is that
// of a base path at its place, is part of its density.

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

template <class Guide>
class GradientPath {
 public:
  GradientPath(const GradientContext<Guide>& context, Sampler& rng, PathStatistics& statistics)
      : scene_(context.scene),
        camera_(context.camera),
        options_(context.options),
        guide_(context.guide),
        rng_(rng),
        statistics_(statistics) {}

  /// Traces a base path through a random point of the pixel, with its offset paths.
  GradientSample trace(int x, int y) {
    ++statistics_.paths;
    start(x, y);
    for (depth_ = 1; arrive() && scatter();) ++depth_;
    return result_;
  }

 private:
  using Vertex = typename Guide::Vertex;
  using Offsets = std::array<OffsetPath, kNeighbours.size()>;

  // A vertex at which the base path may scatter by the non-delta component, with probability 1 − delta.
  struct Scattering {
    const SurfaceHit& hit;
    const Vertex& vertex;
    const LightSelection lights;
    float delta;
  };
  // The same for an offset path that is separate.
  struct OffsetScattering {
    OffsetScattering(const Guide& guide, const SurfaceHit& hit, const Lights& all, float delta)
        : vertex(guide, hit), lights(all.at(hit)), smooth(1.0f - delta) {}
    Vertex vertex;
    LightSelection lights;
    float smooth;
  };
  using OffsetScatterings = std::array<std::optional<OffsetScattering>, kNeighbours.size()>;

  void start(int x, int y) {
    const CameraSample sample = camera_.sample(rng_);
    const Ray ray = camera_.rayThrough(x, y, sample);
    direction_ = ray.direction;
    hit_ = scene_.firstVisible(ray, options_.emitterVisibility, statistics_.segments);
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      const int nextX = x + kNeighbours[i][0], nextY = y + kNeighbours[i][1];
      if (nextX < 0 || nextY < 0 || nextX >= camera_.width() || nextY >= camera_.height()) continue;
      const Ray shifted = camera_.rayThrough(nextX, nextY, sample);
      continueApart(offsets_[i], shifted.direction,
                    scene_.firstVisible(shifted, options_.emitterVisibility, statistics_.segments));
    }
  }

  // The offset path has arrived at a vertex of its own, or left the scene, which the base path must have done, too.
  void continueApart(OffsetPath& offset, const Vec3& direction, const std::optional<SurfaceHit>& hit) const {
    offset.state = hit.has_value() == hit_.has_value() ? OffsetPath::State::apart : OffsetPath::State::failed;
    offset.direction = direction;
    offset.hit = hit;
  }

  // Adds emission where the path has arrived; returns false if it ends there.
  bool arrive() {
    if (depth_ > 1 || options_.emitterVisibility == EmitterVisibility::shown) addEmission();
    if (!hit_ || !hit_->bsdf || depth_ >= options_.maxDepth || !sidesAgree(*hit_, hit_->woWorld, hit_->wo))
      return false;
    for (OffsetPath& offset : offsets_)
      if (offset.isSeparate() && !scattersToo(offset)) offset.fail();
    return true;
  }

  bool scattersToo(const OffsetPath& offset) const {
    const SurfaceHit& hit = *offset.hit;
    if (!hit.bsdf || !sidesAgree(hit, hit.woWorld, hit.wo)) return false;
    return offset.state != OffsetPath::State::connected || hit.wo.z() * hit_->wo.z() > 0.0f;
  }

  void addEmission() {
    const Rgb radiance = hit_ ? emittedRadiance(*hit_) : scene_.lights.environmentRadiance(direction_);
    if (!(radiance.maxCoeff() > 0.0f)) return;
    const Contribution base(throughput_ * radiance, 1.0f, 1.0f / misWeight(emissionWeight_, hit_));
    result_.radiance += base.value * base.misWeight();
    for (std::size_t i = 0; i < offsets_.size(); ++i)
      result_.differences[i] +=
          weightedDifference(base, emissionOf(offsets_[i]), offsets_[i].state != OffsetPath::State::apart);
  }

  static float misWeight(const EmissionWeight& weight, const std::optional<SurfaceHit>& hit) {
    return hit ? weight.ofSurface(*hit) : weight.ofEnvironment();
  }

  std::optional<Contribution> emissionOf(const OffsetPath& offset) const {
    if (!offset.exists()) return std::nullopt;
    const std::optional<SurfaceHit>& hit = offset.isSeparate() ? offset.hit : hit_;
    const Vec3& direction = offset.state == OffsetPath::State::apart ? offset.direction : direction_;
    const Rgb radiance = hit ? emittedRadiance(*hit) : scene_.lights.environmentRadiance(direction);
    const float own2 = offset.ratio * offset.ratio;
    return Contribution(offset.throughput * radiance, own2, own2 / misWeight(offset.emissionWeight, hit));
  }

  // Returns false if the path ends.
  bool scatter() {
    if (!survives()) return false;
    const SurfaceHit hit = *hit_;
    const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    if (delta >= 1.0f) return scatterDelta(hit, delta);
    const Vertex vertex(guide_, hit);
    const Scattering at{hit, vertex, scene_.lights.at(hit), delta};
    OffsetScatterings offsets;
    prepare(offsets);
    addDirectLight(at, offsets);
    if (delta > 0.0f && rng_.uniform() < delta) return scatterDelta(hit, delta);
    return scatterSmooth(at, offsets);
  }

  void prepare(OffsetScatterings& scatterings) {
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      if (!offsets_[i].isSeparate()) continue;
      const SurfaceHit& hit = *offsets_[i].hit;
      const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
      if (delta < 1.0f) scatterings[i].emplace(guide_, hit, scene_.lights, delta);
    }
  }

  static float survivalOf(const Rgb& throughput, float eta2, const Rgb& expected) {
    return std::min(std::max(throughput.maxCoeff() * eta2, expected.maxCoeff()), kMaxSurvival);
  }

  // Russian roulette as in the path loop.
  bool survives() {
    if (depth_ < options_.rouletteDepth) return true;
    const float survival = survivalOf(throughput_, eta2_, expected_);
    if (rng_.uniform() >= survival) return false;
    throughput_ /= survival;
    for (OffsetPath& offset : offsets_)
      if (offset.exists())
        offset.scale(grey(1.0f / survival),
                     survivalOf(offset.throughput / offset.ratio, offset.eta2, offset.expected) / survival);
    return true;
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
    const Contribution base(throughput_ * direct.scattered, 1.0f, 1.0f + square(pdf / light->pdf));
    result_.radiance += base.value * base.misWeight();
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      bool sameShift = true;
      const std::optional<Contribution> offset = directLight(at, direct, base, offsets_[i], offsets[i], sameShift);
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

  static float square(float x) { return x * x; }

  ArrivingLight arrivingAt(const SurfacePoint& point, const LightSample& light) {
    ArrivingLight result = scene_.arriving(point, light, options_.maxDepth - depth_ - 1);
    statistics_.shadowRays += static_cast<std::uint64_t>(result.rays);
    return result;
  }

  std::optional<Contribution> directLight(const Scattering& at, const Direct& direct, const Contribution& base,
                                          const OffsetPath& offset, const std::optional<OffsetScattering>& scattering,
                                          bool& sameShift) {
    if (offset.state == OffsetPath::State::merged) {
      const float ratio2 = square(offset.ratio);
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
    return Contribution(value, square(offset.ratio), square(offset.ratio) * (1.0f + square(pdf / direct.light.pdf)));
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
    return Contribution(offset.throughput * f * arriving.radiance * (std::abs(wi.z()) * scale), square(own),
                        square(own) + square(other));
  }

  static float lightJacobian(const LightSample& base, const LightSample& offset) {
    if (base.delta || !base.source) return 1.0f;
    return connectionJacobian(base.source->normal, base.wi * base.distance, offset.wi * offset.distance);
  }

  bool scatterSmooth(const Scattering& at, const OffsetScatterings& scatterings) {
    const std::optional<BsdfSample> sample = at.vertex.sample(rng_, statistics_);
    if (!sample) return false;
    const float pdf = (1.0f - at.delta) * sample->pdf;
    if (!continueAlong(at.hit, sample->wi, sample->f * (std::abs(sample->wi.z()) / pdf))) return false;
    eta2_ *= sample->eta * sample->eta;
    emissionWeight_.scattered(at.lights, direction_, pdf);
    const Smooth smooth{at.hit, *sample, pdf, scattersBroadly(at.hit, sample->f)};
    for (std::size_t i = 0; i < offsets_.size(); ++i)
      if (offsets_[i].exists()) shift(smooth, offsets_[i], scatterings[i]);
    return true;
  }

  // The base path leaves a vertex in a direction that was sampled from the non-delta component, and has arrived at the
  // next vertex.
  struct Smooth {
    const SurfaceHit& hit;
    const BsdfSample& sample;
    float pdf;
    bool broad;
  };

  void shift(const Smooth& base, OffsetPath& offset, const std::optional<OffsetScattering>& scattering) {
    if (offset.state == OffsetPath::State::merged) {
      offset.eta2 *= base.sample.eta * base.sample.eta;
      offset.emissionWeight = emissionWeight_;
      follow(base.hit, base.sample.f * (std::abs(base.sample.wi.z()) / base.pdf), 1.0f, offset);
    } else if (!scattering) {
      offset.fail();
    } else if (offset.state == OffsetPath::State::connected) {
      const SurfaceHit hit = *offset.hit;
      const Vec3 wi = hit.frame.toLocal(direction_);
      if (leave(base, hit, wi, direction_, 1.0f, offset, *scattering)) offset.state = OffsetPath::State::merged;
    } else if (base.broad && (!hit_ || connectable(*hit_))) {
      connect(base, offset, *scattering);
    } else {
      copy(base, offset, *scattering);
    }
  }

  static void follow(const SurfaceHit& hit, const Rgb& contribution, float density, OffsetPath& offset) {
    offset.expected *= hit.bsdf->albedo(hit.wo, hit.uv);
    offset.scale(contribution, density);
  }

  // The offset path leaves a vertex of its own in the direction wi (local). Returns false if it fails.
  bool leave(const Smooth& base, const SurfaceHit& hit, const Vec3& wi, const Vec3& direction, float jacobian,
             OffsetPath& offset, const OffsetScattering& scattering) const {
    const Rgb f = evalBsdf(hit, wi);
    const float pdf = scattering.smooth * scattering.vertex.pdf(wi);
    follow(hit, f * (std::abs(wi.z()) * jacobian / base.pdf), pdf * jacobian / base.pdf, offset);
    if (!sidesAgree(hit, direction, wi) || !correspond(base.hit, base.sample.wi, hit, wi)) offset.fail();
    offset.eta2 *= base.sample.eta * base.sample.eta;
    offset.emissionWeight.scattered(scattering.lights, direction, pdf);
    return offset.exists();
  }

  void connect(const Smooth& base, OffsetPath& offset, const OffsetScattering& scattering) {
    const SurfaceHit hit = *offset.hit;
    Vec3 direction = direction_;
    float jacobian = 1.0f;
    std::optional<SurfaceHit> seen;
    if (hit_) {
      const Vec3 segment = hit_->position - hit.position;
      direction = segment.normalized();
      jacobian = connectionJacobian(hit_->normal, hit_->position - base.hit.position, segment);
      seen = asSeenFrom(scene_.scene, *hit_, -direction);
      seen->distance = segment.norm();
      if (!connectable(*seen)) return offset.fail();
    }
    const Vec3 wi = hit.frame.toLocal(direction);
    if (!scattersBroadly(hit, evalBsdf(hit, wi))) return offset.fail();
    if (!leave(base, hit, wi, direction, jacobian, offset, scattering)) return;
    ++statistics_.shadowRays;
    const bool clear = hit_ ? scene_.visible(hit, *hit_) : !scene_.tracer.occluded(spawnRay(hit, direction));
    if (!clear) return offset.fail();
    offset.state = OffsetPath::State::connected;
    offset.hit = seen;
  }

  void copy(const Smooth& base, OffsetPath& offset, const OffsetScattering& scattering) {
    const SurfaceHit hit = *offset.hit;
    const std::optional<ShiftedDirection> shifted = copiedDirection(base, hit);
    if (!shifted) return offset.fail();
    const Vec3& wi = shifted->wi;
    if (!leave(base, hit, wi, hit.frame.toWorld(wi).normalized(), shifted->jacobian, offset, scattering)) return;
    traceApart(hit, wi, offset);
    // Such a path would be shifted by a connection.
    if (offset.exists() && scattersBroadly(hit, evalBsdf(hit, wi)) && (!offset.hit || connectable(*offset.hit)))
      offset.fail();
  }

  // The smallest rotation that aligns the shading normals maps the half vector: tangents may differ much on
  // neighbouring triangles.
  static std::optional<ShiftedDirection> copiedDirection(const Smooth& base, const SurfaceHit& hit) {
    const Frame& from = base.hit.frame;
    if (!(from.n.dot(hit.frame.n) > 0.0f)) return std::nullopt;
    const auto rotation = Eigen::Quaternionf::FromTwoVectors(from.n, hit.frame.n);
    const auto rotated = [&](const Vec3& local) -> Vec3 { return hit.frame.toLocal(rotation * from.toWorld(local)); };
    return copyHalfVector(rotated(base.hit.wo), rotated(base.sample.wi), base.sample.eta, hit.wo);
  }

  bool scatterDelta(const SurfaceHit& hit, float fraction) {
    statistics_.countDelta();
    const std::optional<DeltaSample> sample = sampleDelta(hit, rng_.uniform());
    if (!sample) return false;
    emissionWeight_.passed(hit, sample->wi, scene_.shadowSurfaces);
    if (!continueAlong(hit, sample->wi, sample->weight / fraction)) return false;
    eta2_ *= sample->eta * sample->eta;
    for (OffsetPath& offset : offsets_)
      if (offset.exists()) shiftDelta(hit, *sample, fraction, offset);
    return true;
  }

  void shiftDelta(const SurfaceHit& base, const DeltaSample& sample, float fraction, OffsetPath& offset) {
    if (offset.state == OffsetPath::State::merged) {
      offset.eta2 *= sample.eta * sample.eta;
      offset.emissionWeight.passed(base, sample.wi, scene_.shadowSurfaces);
      return follow(base, sample.weight / fraction, 1.0f, offset);
    }
    const SurfaceHit hit = *offset.hit;
    const std::optional<DeltaSample> same =
        offset.state == OffsetPath::State::apart ? deltaComponent(hit, sample.component) : std::nullopt;
    if (!same || !correspondDelta(base, sample, hit, *same)) return offset.fail();
    const float ofBase = fraction * sample.probability;
    follow(hit, same->weight * (same->probability / ofBase),
           hit.bsdf->deltaProbability(hit.wo, hit.uv) * same->probability / ofBase, offset);
    offset.eta2 *= same->eta * same->eta;
    offset.emissionWeight.passed(hit, same->wi, scene_.shadowSurfaces);
    traceApart(hit, same->wi, offset);
  }

  static bool correspondDelta(const SurfaceHit& base, const DeltaSample& baseSample, const SurfaceHit& offset,
                              const DeltaSample& sample) {
    return (base.wo.z() * baseSample.wi.z() > 0.0f) == (offset.wo.z() * sample.wi.z() > 0.0f) &&
           (baseSample.eta == 1.0f) == (sample.eta == 1.0f);
  }

  // Traces the offset path to its next vertex in a direction that is local in hit.frame.
  void traceApart(const SurfaceHit& hit, const Vec3& wi, OffsetPath& offset) {
    const Vec3 direction = hit.frame.toWorld(wi).normalized();
    if (!offset.exists() || !sidesAgree(hit, direction, wi)) return offset.fail();
    ++statistics_.segments;
    continueApart(offset, direction, scene_.tracer.trace(spawnRay(hit, direction)));
  }

  // Traces the base path to its next vertex; returns false if it ends.
  bool continueAlong(const SurfaceHit& hit, const Vec3& wi, const Rgb& weight) {
    direction_ = hit.frame.toWorld(wi).normalized();
    if (!sidesAgree(hit, direction_, wi)) return false;
    throughput_ *= weight;
    if (!(throughput_.maxCoeff() > 0.0f)) return false;
    expected_ *= hit.bsdf->albedo(hit.wo, hit.uv);
    ++statistics_.segments;
    hit_ = scene_.tracer.trace(spawnRay(hit, direction_));
    return true;
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
  const PathOptions& options_;
  const Guide& guide_;
  Sampler& rng_;
  PathStatistics& statistics_;
  GradientSample result_;

  // The base path.
  std::optional<SurfaceHit> hit_;  // where it has arrived; nullopt: it has left the scene
  Vec3 direction_ = Vec3::Zero();
  int depth_ = 0;
  Rgb throughput_ = Rgb::Ones();
  Rgb expected_ = Rgb::Ones();
  float eta2_ = 1;
  EmissionWeight emissionWeight_ = {};

  Offsets offsets_;
};

}  // namespace lobe
