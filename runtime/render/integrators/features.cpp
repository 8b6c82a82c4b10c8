#include "runtime/render/integrators/features.h"

#include <algorithm>
#include <array>
#include <optional>

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

constexpr int kMostSurfaces = 16;                // on one way, of specular surfaces
constexpr float kLeastProbability = 0.1f;        // of a way that is followed
constexpr float kRounding = 1e-4f;               // more than that of probabilities
constexpr float kStepWithoutSample = 1.0f / 64;  // of the choice, less than the probability of ways that are followed

/// Whether everything passes straight through a surface.
bool isInvisible(const SurfaceHit& hit) {
  if (!hit.bsdf || hit.emitter || hit.bsdf->deltaProbability(hit.wo, hit.uv) < 1.0f) return false;
  const std::optional<DeltaTransmission> passed = hit.bsdf->deltaTransmission(hit.wo, hit.uv);
  return passed && passed->straight && (passed->weight > 0.999f).all();
}

float depthAlong(const RenderScene& scene, const RayCamera& camera, std::optional<SurfaceHit> hit) {
  for (int i = 0; hit && i < kMostSurfaces && isInvisible(*hit); ++i)
    hit = scene.tracer.trace(spawnRay(*hit, -hit->woWorld));
  return hit ? std::min(kNoDepth, camera.depthOf(hit->position) / scene.scene.scale) : kNoDepth;
}

/// Follows a camera ray to the first surfaces that are not purely specular.
class SpecularTree {
 public:
  SpecularTree(const RenderScene& scene, Features& sum) : scene_(scene), sum_(sum) {}

  /// The ways from a surface. probability: of the way to it.
  void add(const SurfaceHit& hit, float probability, int surfaces) const {
    const bool specular = hit.bsdf && hit.bsdf->deltaProbability(hit.wo, hit.uv) >= 1.0f;
    if (!specular || surfaces >= kMostSurfaces || !continueFrom(hit, probability, surfaces + 1))
      addSurface(hit, probability);
  }

 private:
  /// The components of a purely specular surface that are followed.
  struct Ways {
    std::array<DeltaSample, 4> all;
    std::size_t count = 0;
    float sum = 0;

    void add(const DeltaSample& way) {
      all[count++] = way;
      sum += way.probability;
    }
  };

  // Ways of low probability are left out, so that their number is limited, except where no other is left.
  static Ways waysFrom(const SurfaceHit& hit, float probability) {
    Ways ways;
    std::optional<DeltaSample> likeliest, last;
    for (float choice = 0; choice < 1.0f && ways.count < ways.all.size();) {
      const std::optional<DeltaSample> way = sampleDelta(hit, choice);
      // A component may have no sample, such as metal seen from behind in a blend with glass.
      if (!way) {
        choice += kStepWithoutSample;
        continue;
      }
      // Because of rounding, a choice at the end of the last component may return it again.
      const bool again = last && way->component == last->component;
      choice += again ? kRounding : std::max(way->probability, kRounding);
      if (again) continue;
      if (probability * way->probability >= kLeastProbability) ways.add(*way);
      if (!likeliest || way->probability > likeliest->probability) likeliest = way;
      last = way;
    }
    if (ways.count == 0 && likeliest) ways.add(*likeliest);
    return ways;
  }

  bool continueFrom(const SurfaceHit& hit, float probability, int surfaces) const {
    const Ways ways = waysFrom(hit, probability);
    for (std::size_t i = 0; i < ways.count; ++i) {
      const DeltaSample& way = ways.all[i];
      const Vec3 direction = hit.frame.toWorld(way.wi).normalized();
      const std::optional<SurfaceHit> next = scene_.tracer.trace(spawnRay(hit, direction));
      if (next) add(*next, probability * way.probability / ways.sum, surfaces);
    }
    return ways.count > 0;
  }

  void addSurface(const SurfaceHit& hit, float probability) const {
    if (hit.bsdf) sum_.albedo += probability * hit.bsdf->albedo(hit.wo, hit.uv).max(0.0f).min(1.0f);
    const bool front = hit.normal.dot(hit.woWorld) >= 0.0f;
    sum_.normal += probability * (front ? hit.frame.n : Vec3(-hit.frame.n));
  }

  const RenderScene& scene_;
  Features& sum_;
};

}  // namespace

Features featuresAlong(const RenderScene& scene, const RayCamera& camera, const Ray& ray,
                       EmitterVisibility visibility) {
  Features features;
  std::uint64_t rays = 0;
  const std::optional<SurfaceHit> hit = scene.firstVisible(ray, visibility, rays);
  features.depth = depthAlong(scene, camera, hit);
  if (hit) SpecularTree(scene, features).add(*hit, 1.0f, 0);
  return features;
}

void FeatureFilm::addMissing(const Film& film, const RenderScene& scene, const RayCamera& camera,
                             const RenderOptions& options) {
  parallelForEach(0, height_, [&](int y) {
    for (int x = 0; x < width_; ++x) {
      Pixel& pixel = pixels_[static_cast<std::size_t>(y) * width_ + x];
      for (; pixel.samples < film.pixel(x, y).samples(); ++pixel.samples) {
        throwIfCancelled();
        Sampler rng = options.sampler(static_cast<std::uint64_t>(y) * width_ + x, static_cast<int>(pixel.samples));
        const Features features = featuresAlong(scene, camera, camera.sample(x, y, rng), scene.scene.emitterVisibility);
        pixel.albedo += features.albedo.cast<double>();
        pixel.normal += features.normal.array().cast<double>();
        pixel.depth = std::min(pixel.depth, features.depth);
      }
    }
  });
}

template <class Value>
Image FeatureFilm::map(const Value& value) const {
  Image image(width_, height_);
  for (std::size_t i = 0; i < pixels_.size(); ++i) image.pixels[i] = value(pixels_[i]);
  return image;
}

Image FeatureFilm::albedo() const {
  return map([](const Pixel& p) { return Rgb((p.albedo / std::max(1u, p.samples)).cast<float>()); });
}

Image FeatureFilm::normal() const {
  return map([](const Pixel& p) { return Rgb((p.normal / std::max(1u, p.samples)).cast<float>()); });
}

Image FeatureFilm::depth() const {
  return map([](const Pixel& p) { return grey(p.depth); });
}

}  // namespace lobe
