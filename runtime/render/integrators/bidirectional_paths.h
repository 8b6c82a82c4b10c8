#pragma once
// Bidirectional path tracing (Veach 1997, Chapter 10): for each camera ray a light path is traced, too; every vertex of
// the camera path is connected to every vertex of the light path and to a point sampled on a light, every vertex of the
// light path to the camera, and all techniques are combined by multiple importance sampling (partial_weights.h). Light
// paths do not hit the lens.
//
// Vertices of camera paths may also be merged with the vertices of all light paths of the same sample of the image, the
// photons, within a radius (vertex connection and merging, Georgiev et al. 2012, "Light Transport Simulation with
// Vertex Connection and Merging"). The estimate then has a bias, which vanishes with the radius.
//
// Directions of both subpaths are sampled by guides, which path_loop.h defines. The densities in the weights are those
// of the guides in both directions.
//
// Light tracing alone (traceLight) makes the light paths for light_tracing.h: their vertices are connected to the
// camera only, and weighted against camera paths with next-event estimation that passes through surfaces
// (RenderScene::arriving).
//
// Connections do not pass through surfaces that transmit light: what is behind glass is found by tracing rays. A point
// or directional light behind glass is therefore not seen in a mirror.

#include <cmath>
#include <deque>

#include "runtime/render/film/light_image.h"
#include "runtime/render/integrators/light_tracing.h"
#include "runtime/render/integrators/partial_weights.h"
#include "runtime/render/integrators/path_loop.h"
#include "runtime/render/integrators/photon_grid.h"

namespace lobe {

template <class CameraGuide, class LightGuide>
class BidirectionalPaths {
  struct Walk;

 public:
  /// All references must outlive it.
  BidirectionalPaths(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                     const CameraGuide& cameraGuide, const LightGuide& lightGuide)
      : scene_(scene), camera_(camera), options_(options), cameraGuide_(cameraGuide), lightGuide_(lightGuide) {}

  /// Lets radiance merge vertices with photons, which must outlive it.
  void mergeWith(const PhotonGrid& photons) { photons_ = &photons, merging_ = photons.area() * lightPaths(); }
  /// Appends the vertices of the light path that radiance traces with the same random numbers, to be merged with within
  /// a radius.
  void storePhotons(Sampler& lightRng, PathStatistics& statistics, float radius, std::vector<Photon>& photons) {
    merging_ = PhotonGrid::areaOf(radius) * lightPaths();
    LightPath path;
    traceLightPath(lightRng, statistics, path);
    for (const LightVertex& v : path.vertices)
      photons.push_back({v.hit.position, v.hit.normal, v.hit.woWorld, v.throughput, v.weights, v.depth, v.delta});
  }

  /// Traces a light path for camera paths that are weighted by the same LightTracing.
  void traceLight(const LightTracing& tracing, Sampler& lightRng, PathStatistics& statistics,
                  std::vector<Splat>& splats) {
    tracing_ = &tracing;
    LightPath path;
    traceLightPath(lightRng, statistics, path);
    connectToCamera(path, statistics, splats);
  }

  /// See BidirectionalIntegrator.
  Rgb radiance(const Ray& cameraRay, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
               std::vector<Splat>* splats) const {
    ++statistics.paths;
    Sample sample{rng, statistics};
    traceLightPath(lightRng, statistics, sample.light);
    if (splats) connectToCamera(sample.light, statistics, *splats);
    traceCameraPath(sample, cameraRay);
    return sample.found.limited(options_.fireflyLimit, statistics.cut);
  }

  // ---- What gradient-domain rendering uses to connect pairs of paths. Densities and values are those of single
  // techniques, without multiple importance weights.

  /// A vertex with a non-delta component. throughput: without the BSDF at this vertex; on light paths the flux.
  template <class Guide>
  struct Vertex {
    Vertex(const Guide& guide, const SurfaceHit& h, const Walk& walk, const PartialWeights& partial, float fraction)
        : hit(h),
          weights(partial),
          throughput(walk.throughput),
          depth(walk.depth),
          smooth(fraction),
          arrivalPdf(walk.pdf),
          survival(walk.survival),
          delta(walk.delta),
          sampler(guide, hit) {}
    Vertex(const Vertex&) = delete;
    Vertex& operator=(const Vertex&) = delete;

    /// The density with which the subpath continues in a direction (world space).
    float pdf(const Vec3& direction) const { return smooth * sampler.pdf(hit.frame.toLocal(direction)); }

    SurfaceHit hit;
    PartialWeights weights;
    Rgb throughput;
    int depth;         // segments from the origin of the subpath
    float smooth;      // probability of sampling the non-delta component
    float arrivalPdf;  // Walk::pdf
    float survival;    // Walk::survival
    bool delta;        // Walk::delta
    typename Guide::Vertex sampler;
  };
  using CameraVertex = Vertex<CameraGuide>;
  using LightVertex = Vertex<LightGuide>;

  struct LightPath {
    Vec2 lens = Vec2::Zero();  ///< point of the lens to which the path is connected
    std::optional<EmittedPhoton> photon = {};
    std::deque<LightVertex> vertices = {};
  };

  /// Light paths of a sample of the image.
  double lightPaths() const {
    return static_cast<double>(camera_.width()) * camera_.height() * (tracing_ ? tracing_->pathsPerPixel : 1.0);
  }

  /// Traces a light path. Its random numbers are apart from those of the camera path, to which the stratified ones are
  /// left.
  void traceLightPath(Sampler& rng, PathStatistics& statistics, LightPath& path) const {
    if (scene_.lights.empty() || options_.maxDepth < 2) return;
    if (camera_.hasLens()) path.lens = squareToDisk(rng.uniform2());
    const double choice = rng.uniformDouble();
    const Vec2 u1 = rng.uniform2();
    const Vec2 u2 = rng.uniform2();
    path.photon = tracing_ ? tracing_->emission.sample(choice, u1, u2) : scene_.lights.samplePhoton(choice, u1, u2);
    const std::optional<EmittedPhoton>& photon = path.photon;
    if (!photon || !(photon->density > 0.0f) || !(photon->power.maxCoeff() > 0.0f)) return;
    Walk walk{photon->ray, photon->power,
              PartialWeights::fromLight(1, photon->density, photon->cosine(), photon->delta, merging_), rng,
              statistics};
    walk.start = photon->power.maxCoeff();
    walk.photon = &*photon;
    std::optional<SurfaceHit> hit = trace(walk);
    // The last segment of a path of maximum length is a connection.
    while (hit && ++walk.depth < options_.maxDepth && advanceLightPath(path, walk, *hit)) hit = trace(walk);
  }

  /// The connection of a light vertex to the camera.
  struct ViewedVertex {
    CameraView view;
    SurfaceHit seen;  ///< the vertex as the camera sees it
    Rgb value;
    float density;  ///< of camera rays over the area of the surface
    double others;  ///< Splat::others
  };
  /// nullopt: it contributes nothing.
  std::optional<ViewedVertex> viewed(const LightVertex& vertex, const Vec2& lens, PathStatistics& statistics) const {
    std::optional<CameraView> view = camera_.view(vertex.hit.position, lens);
    if (!view) return std::nullopt;
    const Vec3 direction = -view->ray.direction;
    const SurfaceHit seen = asSeenFrom(scene_.scene, vertex.hit, direction);
    const Rgb scattered = evalAdjointBsdf(vertex.hit, seen);
    if (!(scattered.maxCoeff() > 0.0f)) return std::nullopt;
    ++statistics.shadowRays;
    if (!scene_.visibleToCamera(vertex.hit, view->ray, options_.emitterVisibility)) return std::nullopt;
    const float density = view->density * std::abs(vertex.hit.normal.dot(direction));
    const double others =
        squared(density / lightPaths()) * vertex.weights.sumOfOthers(reversePdf(cameraGuide_, seen, vertex.hit));
    const Rgb value = vertex.throughput * scattered * static_cast<float>(density / lightPaths());
    return ViewedVertex{*view, seen, value, density, others};
  }

  /// The connection of a vertex of a camera path with one of a light path.
  struct Connection {
    Rgb value;        ///< without the throughput of the camera path
    SurfaceHit seen;  ///< the light vertex as the camera path sees it
    // Sums of squared densities relative to the connection's: of the techniques with more vertices on the camera path;
    // and of those with fewer, without the factor PartialWeights::sumOfOthers(reverse) of the camera path.
    double longer, shorter;
    float reverse;

    /// The sum over all techniques, this one included, whose shorter camera paths are in `camera`.
    double total(const PartialWeights& camera) const { return 1.0 + longer + shorter * camera.sumOfOthers(reverse); }
  };
  /// hit: the vertex of the camera path, where sampler samples the non-delta component, with the probability `smooth`.
  /// statistics: counts the shadow ray that tests visibility; nullptr: the vertices are known to see each other, and no
  /// ray is traced. nullopt: it contributes nothing.
  std::optional<Connection> connection(const SurfaceHit& hit, const typename CameraGuide::Vertex& sampler, float smooth,
                                       const LightVertex& light, PathStatistics* statistics) const {
    const Vec3 between = light.hit.position - hit.position;
    const float distance2 = between.squaredNorm();
    if (!(distance2 > 0.0f)) return std::nullopt;
    const Vec3 direction = between / std::sqrt(distance2);
    const Vec3 wi = hit.frame.toLocal(direction);
    if (!sidesAgree(hit, direction, wi)) return std::nullopt;
    const Rgb f = evalBsdf(hit, wi);
    if (!(f.maxCoeff() > 0.0f)) return std::nullopt;
    const SurfaceHit seen = asSeenFrom(scene_.scene, light.hit, -direction);
    const Rgb scattered = evalAdjointBsdf(light.hit, seen);
    if (!(scattered.maxCoeff() > 0.0f)) return std::nullopt;
    if (statistics) {
      ++statistics->shadowRays;
      if (!scene_.visible(hit, light.hit)) return std::nullopt;
    }
    // Densities over the area of the vertex at the other end.
    const float toLight = std::abs(light.hit.normal.dot(direction)) / distance2;
    const float toCamera = std::abs(hit.normal.dot(direction)) / distance2;
    const SurfaceHit fromLight = asSeenFrom(scene_.scene, hit, direction);
    return Connection{f * scattered * light.throughput * (std::abs(wi.z()) * toLight), seen,
                      squared(smooth * sampler.pdf(wi) * toLight) *
                          light.weights.sumOfOthers(reversePdf(cameraGuide_, seen, light.hit)),
                      squared(light.pdf(-direction) * toCamera), reversePdf(lightGuide_, fromLight, hit)};
  }

  /// The connection of a vertex of a camera path with a point of a light.
  struct LightConnection {
    Vec3 wi;         ///< local in the frame of the vertex
    Rgb value;       ///< times the density of the point, without the throughput of the camera path
    double density;  ///< of the point, as LightSelection::pdf of a photon
    double hits;     ///< density with which the camera path finds the light
    double
        emission;  ///< with which a light path arrives, without the squared factor PartialWeights::sumOfOthers(reverse)
    float reverse;

    /// The sum of the squared densities of all techniques whose shorter camera paths are in `camera`.
    double total(const PartialWeights& camera) const {
      return squared(density) + squared(hits) + squared(emission) * camera.sumOfOthers(reverse);
    }
  };
  /// As `connection`, for a light sample.
  std::optional<LightConnection> lightConnection(const SurfaceHit& hit, const typename CameraGuide::Vertex& sampler,
                                                 float smooth, const LightSample& light,
                                                 PathStatistics* statistics) const {
    const Vec3 wi = hit.frame.toLocal(light.wi);
    if (!sidesAgree(hit, light.wi, wi)) return std::nullopt;
    const Rgb f = evalBsdf(hit, wi);
    if (!(f.maxCoeff() > 0.0f)) return std::nullopt;
    if (statistics) {
      ++statistics->shadowRays;
      if (!scene_.visible(hit, light)) return std::nullopt;
    }
    // A point light has a density over solid angle in the sense of LightSelection::pdf.
    const double unit = light.delta && light.source ? squared(light.distance) : 1.0;
    const SurfaceHit seen = asSeenFrom(scene_.scene, hit, light.wi);
    return LightConnection{wi,
                           f * light.radiance * static_cast<float>(std::abs(wi.z()) * unit),
                           light.pdf * unit,
                           light.delta ? 0.0 : smooth * sampler.pdf(wi),
                           emissionDensity(hit, light),
                           reversePdf(lightGuide_, seen, hit)};
  }

  /// The density with which a light path arrives at a hit from a light sample, in the measure of LightConnection.
  double emissionDensity(const SurfaceHit& hit, const LightSample& light) const {
    const bool onSurface = light.source && !light.delta;
    const double cosineAtLight = onSurface ? std::abs(light.source->normal.dot(light.wi)) : 1.0f;
    return scene_.lights.photonDensity(light) * std::abs(hit.normal.dot(light.wi)) / cosineAtLight;
  }

 private:
  /// A subpath that is being traced.
  struct Walk {
    Ray ray;
    Rgb throughput;
    PartialWeights weights;
    Sampler& rng;
    PathStatistics& statistics;
    LightSelection nextEvent = {};  // at the last vertex of a camera path
    int depth = 0;
    float eta2 = 1;                         // as in PathLoop; 1 on light paths
    Rgb expected = Rgb::Ones();             // as in PathLoop
    float start = 1;                        // largest component of the first throughput
    const EmittedPhoton* photon = nullptr;  // at the start of a light path
    bool delta = false;         // the vertex next to the light, as far as it is known, scatters by a delta component
    LightPassage passage = {};  // of a light path
    float pdf = 1;       // over solid angle, of the direction of the ray; 0: of a delta component; 1 at the origin
    float survival = 1;  // probability of surviving Russian roulette at the last vertex
  };

  struct Sample {
    Sampler& rng;
    PathStatistics& statistics;
    FoundLight found = {};
    LightPath light = {};
  };

  // ---- Light path

  bool advanceLightPath(LightPath& path, Walk& walk, const SurfaceHit& hit) const {
    if (!arrive(walk, hit) || !survives(walk)) return false;
    const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    const bool ends = walk.depth + 1 >= options_.maxDepth;
    if (delta >= 1.0f) return !ends && scatterDelta<Transport::flux>(walk, hit, delta);
    const PartialWeights weights = walk.passage.specular ? withNextEvent(walk, hit) : walk.weights;
    const LightVertex& vertex = path.vertices.emplace_back(lightGuide_, hit, walk, weights, 1.0f - delta);
    return !ends && scatter<Transport::flux>(walk, vertex, delta);
  }

  /// The weights at a vertex up to which light has met delta components only. Next-event estimation there has the same
  /// receiver as on a camera path, which arrives on the same side of a surface that only reflects.
  PartialWeights withNextEvent(const Walk& walk, const SurfaceHit& hit) const {
    PartialWeights weights = walk.weights;
    const bool fromEnvironment = walk.photon->light < 0;
    if (walk.passage.found(fromEnvironment)) {
      const LightSelection nextEvent = scene_.lights.at(hit);
      weights.connect(fromEnvironment ? nextEvent.environmentPdf(hit.woWorld)
                                      : nextEvent.pdf(*walk.photon, walk.passage.distance + hit.distance));
    } else {
      weights.disconnect();
    }
    return weights;
  }

  void connectToCamera(const LightPath& path, PathStatistics& statistics, std::vector<Splat>& splats) const {
    for (const LightVertex& vertex : path.vertices) {
      const std::optional<ViewedVertex> viewedVertex = viewed(vertex, path.lens, statistics);
      if (!viewedVertex) continue;
      const double others = viewedVertex->others;
      const Rgb value = viewedVertex->value * static_cast<float>(1.0 / (1.0 + others));
      const PathKind kind{Technique::lightTracing, vertex.depth + 1, vertex.delta};
      statistics.largest.add(luminance(value), kind);
      splats.push_back({viewedVertex->view.film,
                        FoundLight::limited(value, kind.segments, options_.fireflyLimit, statistics.cut), others});
    }
  }

  // ---- Camera path

  void traceCameraPath(Sample& sample, const Ray& ray) const {
    if (options_.maxDepth < 1) return;
    const bool dark = options_.emitterVisibility != EmitterVisibility::shown;
    std::optional<SurfaceHit> hit = scene_.firstVisible(ray, options_.emitterVisibility, sample.statistics.segments);
    if (!hit) {
      if (!dark) contribute(sample, scene_.lights.environmentRadiance(ray.direction), {Technique::emission, 1, false});
      return;
    }
    if (!dark) contribute(sample, emittedRadiance(*hit), {Technique::emission, 1, false});
    Walk walk{ray, Rgb::Ones(), PartialWeights::fromCamera(camera_.density(ray, hit->distance), lightPaths(), merging_),
              sample.rng, sample.statistics};
    while (hit && ++walk.depth < options_.maxDepth && advanceCameraPath(sample, walk, *hit)) {
      hit = trace(walk);
      addEmission(sample, walk, hit);
    }
  }

  bool advanceCameraPath(Sample& sample, Walk& walk, const SurfaceHit& hit) const {
    if (!arrive(walk, hit) || !survives(walk)) return false;
    walk.nextEvent = scene_.lights.at(hit);
    const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
    if (delta >= 1.0f) return scatterDelta<Transport::radiance>(walk, hit, delta);
    const CameraVertex vertex(cameraGuide_, hit, walk, walk.weights, 1.0f - delta);
    addDirectLight(sample, vertex, walk.nextEvent);
    for (const LightVertex& light : sample.light.vertices) {
      if (walk.depth + light.depth >= options_.maxDepth) break;
      connect(sample, vertex, light);
    }
    if (photons_) photons_->forEachNear(hit.position, [&](const Photon& photon) { merge(sample, vertex, photon); });
    return scatter<Transport::radiance>(walk, vertex, delta);
  }

  /// Emission that the last segment of a camera path has found, on a surface or in the environment.
  void addEmission(Sample& sample, const Walk& walk, const std::optional<SurfaceHit>& hit) const {
    const Lights& lights = scene_.lights;
    if (hit && !hit->emitter) return;
    const Vec3& direction = walk.ray.direction;
    const Rgb emitted = hit ? emittedRadiance(*hit) : lights.environmentRadiance(direction);
    if (!(emitted.maxCoeff() > 0.0f)) return;
    const double others =
        hit ? walk.weights.atLight(walk.nextEvent.pdf(*hit), lights.photonDensity(*hit), hit->normal.dot(hit->woWorld))
            : walk.weights.atLight(walk.nextEvent.environmentPdf(direction), lights.environmentPhotonDensity(direction),
                                   1.0f);
    contribute(sample, walk.throughput * emitted * static_cast<float>(1.0 / (1.0 + others)),
               {Technique::emission, walk.depth + 1, walk.delta});
  }

  /// Next-event estimation: connects to a point that is sampled on a light.
  void addDirectLight(Sample& sample, const CameraVertex& vertex, const LightSelection& lights) const {
    const SurfaceHit& hit = vertex.hit;
    const double choice = sample.rng.stratifiedDouble();
    const std::optional<LightSample> light = lights.sample(choice, sample.rng.stratified2());
    if (!light) return;
    const std::optional<LightConnection> found =
        lightConnection(hit, vertex.sampler, vertex.smooth, *light, &sample.statistics);
    if (!found) return;
    const double weight = squared(found->density) / found->total(vertex.weights);
    contribute(sample, vertex.throughput * found->value * static_cast<float>(weight / found->density),
               {Technique::nextEvent, vertex.depth + 1, false});
  }

  void connect(Sample& sample, const CameraVertex& vertex, const LightVertex& light) const {
    const std::optional<Connection> found =
        connection(vertex.hit, vertex.sampler, vertex.smooth, light, &sample.statistics);
    if (!found) return;
    contribute(sample, vertex.throughput * found->value * static_cast<float>(1.0 / found->total(vertex.weights)),
               {Technique::connection, vertex.depth + light.depth + 1, light.delta});
  }

  void merge(Sample& sample, const CameraVertex& vertex, const Photon& photon) const {
    const SurfaceHit& hit = vertex.hit;
    if (vertex.depth + photon.depth > options_.maxDepth) return;
    const Vec3 wi = hit.frame.toLocal(photon.direction);
    if (!sidesAgree(hit, photon.direction, wi)) return;
    const Rgb f = evalBsdf(hit, wi);
    if (!(f.maxCoeff() > 0.0f)) return;
    const SurfaceHit seen = asSeenFrom(scene_.scene, hit, photon.direction);
    const double weight =
        vertex.weights.ofMerging(reversePdf(lightGuide_, seen, hit), photon.weights, vertex.pdf(photon.direction));
    // The density of photons over area contains the cosine to the geometric normal where they arrived.
    const float cosine = std::abs(photon.normal.dot(photon.direction));
    contribute(sample,
               vertex.throughput * f * photon.flux * static_cast<float>(std::abs(wi.z()) / cosine * weight / merging_),
               {Technique::merging, vertex.depth + photon.depth, photon.delta});
  }

  // ---- Both

  static void contribute(Sample& sample, const Rgb& value, const PathKind& kind) {
    sample.found.add(value, kind.segments);
    sample.statistics.largest.add(luminance(value), kind);
  }

  std::optional<SurfaceHit> trace(Walk& walk) const {
    ++walk.statistics.segments;
    return scene_.tracer.trace(walk.ray);
  }

  /// Updates the weights at a hit; returns false if nothing is scattered there.
  static bool arrive(Walk& walk, const SurfaceHit& hit) {
    const float cosine = std::abs(hit.normal.dot(hit.woWorld));
    if (!hit.bsdf || !(cosine > 0.0f) || !sidesAgree(hit, hit.woWorld, hit.wo)) return false;
    const bool first = walk.photon ? walk.passage.specular : walk.depth == 1;
    walk.weights.arrive(first ? 1.0f : hit.distance, cosine);
    return true;
  }

  /// Russian roulette by throughput, as in PathLoop.
  bool survives(Walk& walk) const {
    if (walk.depth < options_.rouletteDepth) return true;
    const float carried = std::max(walk.throughput.maxCoeff() * walk.eta2 / walk.start, walk.expected.maxCoeff());
    walk.survival = std::min(carried, kMaxSurvival);
    if (!(walk.rng.uniform() < walk.survival)) return false;
    walk.throughput /= walk.survival;
    return true;
  }

  /// Scatters a subpath; returns false if it ends.
  template <Transport transport, class Guide>
  bool scatter(Walk& walk, const Vertex<Guide>& vertex, float delta) const {
    const SurfaceHit& hit = vertex.hit;
    if (delta > 0.0f && walk.rng.uniform() < delta) return scatterDelta<transport>(walk, hit, delta);
    const std::optional<BsdfSample> scattered = vertex.sampler.sample(walk.rng, walk.statistics);
    if (!scattered) return false;
    const float pdf = vertex.smooth * scattered->pdf;
    walk.pdf = pdf;
    const Vec3 direction = hit.frame.toWorld(scattered->wi).normalized();
    if (!sidesAgree(hit, direction, scattered->wi)) return false;
    const SurfaceHit seen = asSeenFrom(scene_.scene, hit, direction);
    const float cosine = std::abs(hit.normal.dot(direction));
    walk.weights = vertex.weights;
    rememberDelta<transport>(walk, false);
    if constexpr (transport == Transport::flux) {
      walk.weights.scatter(pdf, reversePdf(cameraGuide_, seen, hit), cosine);
      if (tracing_) walk.weights.disconnect();
      walk.passage.scatter();
      return continueAlong(walk, hit, direction, evalAdjointBsdf(hit, seen) * (cosine / pdf));
    } else {
      walk.weights.scatter(pdf, reversePdf(lightGuide_, seen, hit), cosine);
      walk.eta2 *= squaredEta(scattered->eta);
      return continueAlong(walk, hit, direction, scattered->f * (std::abs(scattered->wi.z()) / pdf));
    }
  }

  template <Transport transport>
  bool scatterDelta(Walk& walk, const SurfaceHit& hit, float fraction) const {
    walk.statistics.countDelta();
    walk.pdf = 0;
    rememberDelta<transport>(walk, true);
    constexpr bool flux = transport == Transport::flux;
    const float choice = walk.rng.uniform();
    const std::optional<DeltaSample> scattered = flux ? sampleAdjointDelta(hit, choice) : sampleDelta(hit, choice);
    if (!scattered) return false;
    const Vec3 direction = hit.frame.toWorld(scattered->wi).normalized();
    if (!sidesAgree(hit, direction, scattered->wi)) return false;
    if (!sameFrame(hit, asSeenFrom(scene_.scene, hit, direction))) {
      // The delta component takes another way in the other direction.
      if (flux) return false;
      walk.weights.exclude();
    }
    scatterDelta<transport>(walk, hit, *scattered);
    if (!flux) walk.eta2 *= squaredEta(scattered->eta);
    return continueAlong(walk, hit, direction, scattered->weight / fraction);
  }

  template <Transport transport>
  static void rememberDelta(Walk& walk, bool delta) {
    if (transport == Transport::radiance || walk.depth == 1) walk.delta = delta;
  }

  template <Transport transport>
  void scatterDelta(Walk& walk, const SurfaceHit& hit, const DeltaSample& scattered) const {
    const float arriving = std::abs(hit.normal.dot(hit.woWorld));
    if constexpr (transport == Transport::flux) {
      walk.passage.pass(hit, scattered.wi, tracing_ ? scene_.shadowSurfaces : 0);
      if (walk.passage.specular) return walk.weights.pass(arriving, scattered.eta);
    }
    walk.weights.scatterDelta(arriving, scattered.eta);
  }

  static bool continueAlong(Walk& walk, const SurfaceHit& hit, const Vec3& direction, const Rgb& weight) {
    walk.throughput *= weight;
    walk.expected *= hit.bsdf->albedo(hit.wo, hit.uv);
    walk.ray = spawnRay(hit, direction);
    return walk.throughput.maxCoeff() > 0.0f;
  }

  static float squaredEta(float eta) { return eta * eta; }

  const RenderScene& scene_;
  const RayCamera& camera_;
  const PathOptions& options_;
  const CameraGuide& cameraGuide_;
  const LightGuide& lightGuide_;
  const PhotonGrid* photons_ = nullptr;
  double merging_ = 0;                     // PartialWeights::fromLight
  const LightTracing* tracing_ = nullptr;  // light paths are connected to the camera only
};

/// A camera path of PathLoop and the light paths of its sample, see BidirectionalIntegrator. Their number is random,
/// with the mean that `tracing` says.
template <class CameraGuide, class LightGuide>
Rgb radianceWithLightPaths(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                           const CameraGuide& cameraGuide, const LightGuide& lightGuide, const LightTracing& tracing,
                           const Ray& ray, Sampler& rng, Sampler& lightRng, PathStatistics& statistics,
                           std::vector<Splat>* splats) {
  BidirectionalPaths paths(scene, camera, options, cameraGuide, lightGuide);
  // Rounded up or down at random; the number is at least 0, because uniformDouble() is below 1.
  const int lightPaths = splats ? static_cast<int>(std::ceil(tracing.pathsPerPixel - lightRng.uniformDouble())) : 0;
  for (int i = 0; i < lightPaths; ++i) paths.traceLight(tracing, lightRng, statistics, *splats);
  return PathLoop(scene, options, cameraGuide, LightPaths(scene, camera, lightGuide, tracing))
      .radiance(ray, rng, statistics);
}

}  // namespace lobe
