#pragma once
// Paths of bidirectional path tracing with all their vertices: the densities with which every technique samples them by
// the explicit formulas (Veach 1997, Chapters 8 and 10), and the contribution. They are products over the whole path,
// against which the sums that are kept up to date along subpaths (partial_weights.h) are tested.
//
// A path has n ≥ 1 vertices that scatter, from the camera on, and an origin, where its light is emitted. Technique t
// samples the first t vertices from the camera and the others from the light: 0 is light tracing, n next-event
// estimation, and n + 1 finds the origin by chance. Densities are over the position on the film in pixels, the area of
// all further vertices, and that of the origin (its direction in the environment; none for a point or distant light).

#include <algorithm>
#include <optional>
#include <vector>

#include "runtime/render/gradients/offset_path.h"
#include "runtime/render/integrators/path_integrator.h"

namespace lobe::test {

struct PathVertex {
  SurfaceHit hit;
  std::optional<double> delta = {};  ///< DeltaSample::component; nullopt: scattering by the non-delta component
  float eta = 1;                     ///< BsdfSample::eta, if a camera path has scattered here
};

struct LightOrigin {
  std::optional<SurfaceHit> surface = {};
  Vec3 direction = Vec3::Zero();  ///< towards the environment, if there is no surface and no light
  int light = -1;                 ///< the number of a point or distant light
};

class ExplicitPath {
 public:
  /// ray: from the camera to the first vertex.
  ExplicitPath(const RenderScene& scene, const RayCamera& camera, const Ray& ray, std::vector<PathVertex> all,
               const LightOrigin& from)
      : vertices(std::move(all)), origin(from), scene_(scene), camera_(camera), ray_(ray) {
    if (origin.light >= 0) {
      const LightSample sought{Vec3::Zero(), 0, Rgb::Zero(), 0, std::nullopt, true, origin.light};
      delta_ = scene_.lights.at(fromCamera(size() - 1)).same(sought);
    }
    if (origin.surface) origin.surface = asSeenFrom(scene.scene, *origin.surface, -towardsLight(size() - 1));
  }

  const Ray& ray() const { return ray_; }
  int size() const { return static_cast<int>(vertices.size()); }

  Vec3 towardsCamera(int k) const {
    return k == 0 ? Vec3(-ray_.direction) : (hit(k - 1).position - hit(k).position).normalized();
  }
  Vec3 towardsLight(int k) const {
    if (k + 1 < size()) return -towardsCamera(k + 1);
    if (delta_) return delta_->wi;
    return origin.surface ? (origin.surface->position - hit(k).position).normalized() : origin.direction;
  }
  /// A vertex as paths from the camera, or from the light, see it.
  SurfaceHit fromCamera(int k) const { return asSeenFrom(scene_.scene, hit(k), towardsCamera(k)); }
  SurfaceHit fromLight(int k) const { return asSeenFrom(scene_.scene, hit(k), towardsLight(k)); }

  /// The density over area with which a direction, of density 1 over solid angle, leads from vertex k to the next.
  double areaOfNext(int k) const {
    if (k + 1 < size()) return area(hit(k), hit(k + 1));
    return origin.surface ? area(hit(k), *origin.surface) : 1.0;
  }

  /// As used in weights: delta components have density 1 from the camera; the density from the light is then the ratio
  /// of the solid angles. The probability of choosing them and Russian roulette are left out.
  double density(int t) const {
    const int n = size();
    double p = 1;
    for (int k = 0; k + 1 < std::min(t, n); ++k) p *= cameraPdf(k) * areaOfNext(k);
    if (t == n + 1) return delta_ ? 0.0 : p * cameraPdf(n - 1) * areaOfNext(n - 1);
    if (t > 0 && vertices[t - 1].delta) return 0;
    if (t == n) return p * nextEvent();
    if (vertices[t].delta) return 0;
    p *= emission();
    for (int k = n - 1; k > t; --k) p *= lightPdf(k) * area(hit(k), hit(k - 1));
    if (t == 0)
      p *=
          static_cast<double>(camera_.width()) * camera_.height() /
          (camera_.density(ray_, (hit(0).position - ray_.origin).norm()) * std::abs(hit(0).normal.dot(ray_.direction)));
    return p;
  }

  /// The factor of the density of technique t that weights leave out: the probability of choosing the delta components,
  /// and for those that the light path has sampled, the ratio of the solid angles, which depends on the cosines to the
  /// shading normal, over that in `density`.
  double choices(int t) const {
    double p = 1;
    for (int k = 0; k < size(); ++k) {
      if (!vertices[k].delta) continue;
      const SurfaceHit at = k < t ? fromCamera(k) : fromLight(k);
      const auto component = deltaComponent(at, *vertices[k].delta);
      p *= at.bsdf->deltaProbability(at.wo, at.uv) * (component ? component->probability : 0);
      if (k > t) p *= std::abs(at.frame.n.dot(towardsCamera(k)) / at.frame.n.dot(towardsLight(k))) / cosineRatio(k);
    }
    return p;
  }

  /// The probability with which a camera path of t vertices survives Russian roulette by throughput.
  double survival(int t, int rouletteDepth) const {
    Rgb throughput = Rgb::Ones(), expected = Rgb::Ones();
    float eta2 = 1;
    double p = 1;
    for (int k = 0; k < std::min(t, size()); ++k) {
      const SurfaceHit at = fromCamera(k);
      if (k + 1 >= rouletteDepth) {
        const float survival = std::min(std::max(throughput.maxCoeff() * eta2, expected.maxCoeff()), kMaxSurvival);
        throughput /= survival;
        p *= survival;
      }
      const auto component = vertices[k].delta ? deltaComponent(at, *vertices[k].delta) : std::nullopt;
      const Vec3 wi = at.frame.toLocal(towardsLight(k));
      throughput *= component ? Rgb(component->weight / at.bsdf->deltaProbability(at.wo, at.uv))
                              : Rgb(evalBsdf(at, wi) * static_cast<float>(std::abs(wi.z()) / cameraPdf(k)));
      const float eta = component ? component->eta : vertices[k].eta;
      eta2 *= eta * eta;
      expected *= at.bsdf->albedo(at.wo, at.uv);
    }
    return p;
  }

  /// In the same measure.
  Eigen::Array3d contribution() const {
    Eigen::Array3d f = emitted().cast<double>();
    for (int k = 0; k < size(); ++k) {
      f *= areaOfNext(k);
      const SurfaceHit at = fromCamera(k);
      if (vertices[k].delta) {
        const auto component = deltaComponent(at, *vertices[k].delta);
        if (!component) return Eigen::Array3d::Zero();
        f *= component->weight.cast<double>() * component->probability;
      } else {
        const Vec3 wi = at.frame.toLocal(towardsLight(k));
        if (!sidesAgree(at, at.woWorld, at.wo) || !sidesAgree(at, towardsLight(k), wi)) return Eigen::Array3d::Zero();
        f *= evalBsdf(at, wi).cast<double>() * std::abs(wi.z());
      }
    }
    return f;
  }

  /// Whether nothing is between vertex k and the next.
  bool visible(int k) const {
    if (k + 1 < size()) return scene_.visible(hit(k), hit(k + 1));
    if (origin.surface) return scene_.visible(hit(k), *origin.surface);
    if (delta_) return scene_.visible(hit(k), *delta_);
    return !scene_.tracer.occluded(spawnRay(hit(k), origin.direction));
  }

  std::vector<PathVertex> vertices;
  LightOrigin origin;

 private:
  const SurfaceHit& hit(int k) const { return vertices[k].hit; }

  static double area(const SurfacePoint& from, const SurfacePoint& to) {
    const Vec3 between = to.position - from.position;
    return std::abs(to.normal.dot(between.normalized())) / static_cast<double>(between.squaredNorm());
  }

  static double smoothPdf(const SurfaceHit& at, const Vec3& direction) {
    if (!sidesAgree(at, at.woWorld, at.wo)) return 0;
    const float smooth = 1 - at.bsdf->deltaProbability(at.wo, at.uv);
    return smooth > 0 ? smooth * at.bsdf->pdf(at.wo, at.frame.toLocal(direction), at.uv) : 0;
  }
  double cameraPdf(int k) const { return vertices[k].delta ? 1 : smoothPdf(fromCamera(k), towardsLight(k)); }
  // n² dA cosθ dω is conserved.
  double lightPdf(int k) const {
    if (!vertices[k].delta) return smoothPdf(fromLight(k), towardsCamera(k));
    const SurfaceHit at = fromCamera(k);
    if (!sameFrame(at, fromLight(k))) return 0;  // light takes another way
    const auto component = deltaComponent(at, *vertices[k].delta);
    if (!component) return 0;
    return cosineRatio(k) / std::pow(static_cast<double>(component->eta), 2);
  }
  double cosineRatio(int k) const {
    return std::abs(hit(k).normal.dot(towardsCamera(k)) / hit(k).normal.dot(towardsLight(k)));
  }

  double nextEvent() const {
    const int last = size() - 1;
    const LightSelection lights = scene_.lights.at(fromCamera(last));
    if (origin.surface) return lights.pdf(*origin.surface) * area(hit(last), *origin.surface);
    return delta_ ? delta_->pdf : lights.environmentPdf(origin.direction);
  }
  // Of the origin and the last vertex.
  double emission() const {
    const int last = size() - 1;
    const double cosine = std::abs(hit(last).normal.dot(towardsLight(last)));
    if (origin.surface) return scene_.lights.photonDensity(*origin.surface) * area(*origin.surface, hit(last));
    if (!delta_) return scene_.lights.environmentPhotonDensity(origin.direction) * cosine;
    const double distance2 = delta_->source ? static_cast<double>(delta_->distance) * delta_->distance : 1.0;
    return scene_.lights.photonDensity(*delta_) * cosine / distance2;
  }
  Rgb emitted() const {
    if (origin.surface) return emittedRadiance(*origin.surface);
    if (delta_) return delta_->radiance;
    return origin.light < 0 ? scene_.lights.environmentRadiance(origin.direction) : Rgb(Rgb::Zero());
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
  Ray ray_;
  std::optional<LightSample> delta_;  // the point or distant light, from the last vertex
};

/// A subpath as bidirectional path tracing traces it with BSDF sampling.
struct Subpath {
  struct Vertex {
    std::optional<SurfaceHit> hit;          ///< nullopt: it has left the scene
    Vec3 direction;                         ///< in which it has arrived
    bool scatters = false;                  ///< also by a non-delta component, so that it may be connected
    double survival = 1;                    ///< product of the probabilities up to here
    std::optional<LightSample> light = {};  ///< of next-event estimation
    std::optional<double> delta = {};       ///< PathVertex::delta of the direction in which it continues
    float eta = 1;                          ///< PathVertex::eta
  };
  std::vector<Vertex> vertices;
  LightOrigin origin;  ///< of a light path
  Vec2 lens = Vec2::Zero();
};

/// Uses the random numbers that GradientBidirectionalPath does.
class SubpathTracer {
 public:
  SubpathTracer(const RenderScene& scene, const RayCamera& camera, const PathOptions& options)
      : scene_(scene), camera_(camera), options_(options) {}

  Subpath fromCamera(const Ray& ray, Sampler& rng) const {
    Walk walk{rng, false, ray, Rgb::Ones()};
    std::uint64_t rays = 0;
    walk.path.vertices.push_back({scene_.firstVisible(ray, options_.emitterVisibility, rays), ray.direction});
    while (scatter(walk)) {
    }
    return walk.path;
  }

  Subpath fromLight(Sampler& rng) const {
    Subpath path;
    if (camera_.hasLens()) path.lens = squareToDisk(rng.uniform2());
    const double choice = rng.uniformDouble();
    const Vec2 u1 = rng.uniform2(), u2 = rng.uniform2();
    const auto photon = scene_.lights.samplePhoton(choice, u1, u2);
    if (!photon) return path;
    Walk walk{rng, true, photon->ray, photon->power};
    walk.start = photon->power.maxCoeff();
    walk.path.lens = path.lens;
    const std::optional<SurfaceHit> hit = scene_.tracer.trace(photon->ray);
    if (!hit) return path;
    walk.path.vertices.push_back({hit, photon->ray.direction});
    walk.path.origin = originOf(*photon, *hit);
    while (scatter(walk)) {
    }
    return walk.path;
  }

 private:
  struct Walk {
    Sampler& rng;
    bool flux;
    Ray ray;
    Rgb throughput;
    Rgb expected = Rgb::Ones();
    float eta2 = 1, start = 1;
    double survival = 1;
    Subpath path = {};
  };

  LightOrigin originOf(const EmittedPhoton& photon, const SurfaceHit& hit) const {
    if (photon.delta) return {std::nullopt, Vec3::Zero(), photon.light};
    if (photon.light < 0) return {std::nullopt, -photon.ray.direction, -1};
    return {scene_.tracer.trace(spawnRay(hit, -photon.ray.direction)), Vec3::Zero(), -1};
  }

  bool scatter(Walk& walk) const {
    const int depth = static_cast<int>(walk.path.vertices.size());
    Subpath::Vertex& vertex = walk.path.vertices.back();
    if (!vertex.hit || !vertex.hit->bsdf || depth >= options_.maxDepth) return false;
    const SurfaceHit& at = *vertex.hit;
    if (!sidesAgree(at, at.woWorld, at.wo) || !survives(walk, depth)) return false;
    vertex.survival = walk.survival;
    const float fraction = at.bsdf->deltaProbability(at.wo, at.uv);
    vertex.scatters = fraction < 1;
    if (!walk.flux && vertex.scatters) {
      const double choice = walk.rng.stratifiedDouble();
      vertex.light = scene_.lights.at(at).sample(choice, walk.rng.stratified2());
    }
    if (walk.flux && depth + 1 >= options_.maxDepth) return false;
    if (fraction >= 1 || (fraction > 0 && walk.rng.uniform() < fraction)) {
      const float choice = walk.rng.uniform();
      const auto sample = walk.flux ? sampleAdjointDelta(at, choice) : sampleDelta(at, choice);
      if (!sample) return false;
      vertex.delta = sample->component;
      return proceed(walk, sample->wi, sample->eta, sample->weight / fraction);
    }
    PathStatistics statistics;
    const auto sample = BsdfSampler::Vertex({}, at).sample(walk.rng, statistics);
    if (!sample) return false;
    vertex.eta = sample->eta;
    const float pdf = (1 - fraction) * sample->pdf;
    const Vec3 direction = at.frame.toWorld(sample->wi).normalized();
    return proceed(walk, sample->wi, sample->eta,
                   walk.flux ? Rgb(evalAdjointBsdf(at, asSeenFrom(scene_.scene, at, direction)) *
                                   (std::abs(at.normal.dot(direction)) / pdf))
                             : Rgb(sample->f * (std::abs(sample->wi.z()) / pdf)));
  }

  bool survives(Walk& walk, int depth) const {
    if (depth < options_.rouletteDepth) return true;
    const float survival =
        std::min(std::max(walk.throughput.maxCoeff() * walk.eta2 / walk.start, walk.expected.maxCoeff()), kMaxSurvival);
    if (!(walk.rng.uniform() < survival)) return false;
    walk.throughput /= survival;
    walk.survival *= survival;
    return true;
  }

  bool proceed(Walk& walk, const Vec3& wi, float eta, const Rgb& weight) const {
    const SurfaceHit& at = *walk.path.vertices.back().hit;
    const Vec3 direction = at.frame.toWorld(wi).normalized();
    walk.throughput *= weight;
    if (!sidesAgree(at, direction, wi) || !(walk.throughput.maxCoeff() > 0)) return false;
    if (walk.flux && walk.path.vertices.back().delta && !sameFrame(at, asSeenFrom(scene_.scene, at, direction)))
      return false;
    walk.expected *= at.bsdf->albedo(at.wo, at.uv);
    if (!walk.flux) walk.eta2 *= eta * eta;
    walk.path.vertices.push_back({scene_.tracer.trace(spawnRay(at, direction)), direction});
    return true;
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
  const PathOptions& options_;
};

}  // namespace lobe::test
