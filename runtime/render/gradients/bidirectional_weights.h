#pragma once
// The multiple importance weights of gradient-domain bidirectional path tracing: PartialWeights of a base path and its
// offset paths (shifted_path.h), over two sets of techniques for each pair.
//
// A technique can only shift a path if its camera path contains all vertices before the one to which the offset path is
// connected, because light paths are not shifted beyond it. A pair therefore has the sums over all techniques, and over
// the group of those that shift the base path to the offset path. Light tracing belongs to the group if the first
// vertex is connected to the second.

#include <array>
#include <optional>

#include "runtime/render/gradients/gradient_film.h"
#include "runtime/render/integrators/light_tracing.h"

namespace lobe {

template <class LightGuide>
class BidirectionalWeights {
 public:
  /// The survival probabilities are left out of the weights.
  static constexpr bool kWeighsRoulette = false;
  struct Step {
    LightSelection lights;
    float pdf, reverse, cosine;
  };
  struct Path {
    PartialWeights all = PartialWeights::none();
    std::optional<LightSelection> nextEvent = {};  ///< at the last vertex, if it did not scatter by a delta component
  };
  struct Pair {
    PartialWeights group = PartialWeights::none();  ///< of the offset path
    PartialWeights baseGroup = PartialWeights::none();
  };

  /// lightPaths: as for PartialWeights::fromCamera.
  BidirectionalWeights(const RenderScene& scene, const RayCamera& camera, const LightGuide& guide, double lightPaths)
      : scene_(scene), camera_(camera), guide_(guide), lightPaths_(lightPaths) {}

  void start(const Ray& ray, const SurfaceHit& hit) {
    base.all = fromCamera(ray, hit);
    for (Pair& pair : pairs) pair.baseGroup = base.all;
  }
  void startOffset(std::size_t i, const Ray& ray, const SurfaceHit& hit) {
    offsets[i].all = pairs[i].group = fromCamera(ray, hit);
  }

  void arrive(const SurfaceHit& hit, int depth) {
    arrive(base.all, hit, depth);
    for (Pair& pair : pairs) arrive(pair.baseGroup, hit, depth);
  }
  void arriveOffset(std::size_t i, const SurfaceHit& hit, int depth) {
    arrive(offsets[i].all, hit, depth);
    arrive(pairs[i].group, hit, depth);
  }

  Step step(const SurfaceHit& hit, const LightSelection& lights, const Vec3& direction, float pdf) const {
    return {lights, pdf, reversePdf(guide_, asSeenFrom(scene_.scene, hit, direction), hit),
            std::abs(hit.normal.dot(direction))};
  }
  void scatter(const Step& step) {
    scatter(base, step);
    for (Pair& pair : pairs) pair.baseGroup.scatter(step.pdf, step.reverse, step.cosine);
  }
  void scatterOffset(std::size_t i, const Step& step) {
    scatter(offsets[i], step);
    pairs[i].group.scatter(step.pdf, step.reverse, step.cosine);
  }

  void scatterDelta(const SurfaceHit& hit, const DeltaSample& sample) {
    const bool reversible = isReversible(hit, sample);
    scatterDelta(base.all, hit, sample, reversible);
    base.nextEvent.reset();
    for (Pair& pair : pairs) scatterDelta(pair.baseGroup, hit, sample, reversible);
  }
  void scatterDeltaOffset(std::size_t i, const SurfaceHit& hit, const DeltaSample& sample) {
    const bool reversible = isReversible(hit, sample);
    scatterDelta(offsets[i].all, hit, sample, reversible);
    offsets[i].nextEvent.reset();
    scatterDelta(pairs[i].group, hit, sample, reversible);
  }

  /// The techniques whose light path contains the next vertex do not find the offset path.
  void copied(std::size_t i) { pairs[i] = {}; }

  /// The weights of a camera path at its first vertex.
  PartialWeights atFirstVertex(const Ray& ray, const SurfaceHit& hit) const {
    PartialWeights weights = fromCamera(ray, hit);
    arrive(weights, hit, 1);
    return weights;
  }

  Path base;
  std::array<Path, kNeighbours.size()> offsets;
  std::array<Pair, kNeighbours.size()> pairs;

 private:
  PartialWeights fromCamera(const Ray& ray, const SurfaceHit& hit) const {
    return PartialWeights::fromCamera(camera_.density(ray, hit.distance), lightPaths_, 0);
  }
  static void arrive(PartialWeights& weights, const SurfaceHit& hit, int depth) {
    weights.arrive(depth == 1 ? 1.0f : hit.distance, std::abs(hit.normal.dot(hit.woWorld)));
  }
  static void scatter(Path& path, const Step& step) {
    path.all.scatter(step.pdf, step.reverse, step.cosine);
    path.nextEvent = step.lights;
  }
  static void scatterDelta(PartialWeights& weights, const SurfaceHit& hit, const DeltaSample& sample, bool reversible) {
    if (!reversible) weights.exclude();
    weights.scatterDelta(std::abs(hit.normal.dot(hit.woWorld)), sample.eta);
  }
  /// Whether light takes the same way in the other direction.
  bool isReversible(const SurfaceHit& hit, const DeltaSample& sample) const {
    return !hit.bsdf->mapsNormals() ||
           sameFrame(hit, asSeenFrom(scene_.scene, hit, hit.frame.toWorld(sample.wi).normalized()));
  }

  const RenderScene& scene_;
  const RayCamera& camera_;
  const LightGuide& guide_;
  double lightPaths_;
};

}  // namespace lobe
