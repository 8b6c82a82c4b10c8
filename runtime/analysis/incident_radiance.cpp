#include "runtime/analysis/incident_radiance.h"

#include <algorithm>
#include <cmath>

#include "runtime/core/sampling.h"
#include "runtime/guiding/guided_density.h"
#include "runtime/render/integrators/path_integrator.h"

namespace lobe {
namespace {

constexpr float kMinNormalCosine = 0.707f;
// Long enough for paths to reach most points that contribute to the image.
constexpr int kReceiverDepth = 8;

Receiver receiverOf(const SurfaceHit& hit) {
  return {hit, std::copysign(1.0f, hit.normal.dot(hit.woWorld)) * hit.normal};
}

/// Samples the BSDF and collects the receivers on the path.
struct CollectingSampler {
  std::vector<Receiver>& receivers;

  class Vertex : public BsdfSampler::Vertex {
   public:
    Vertex(const CollectingSampler& sampler, const SurfaceHit& hit) : BsdfSampler::Vertex({}, hit) {
      sampler.receivers.push_back(receiverOf(hit));
    }
  };
};

/// Multiple importance weight of cosine-weighted sampling for light straight from an emitter (see the header).
float directFraction(float cosine, float emitterPdf) {
  return misWeight(std::max(cosine * kInvPi, 1e-6f), emitterPdf);
}

/// With an empty reflectance, the guided part of the density is the illumination mixture alone.
GuidedDensity guidedDensity(const PackedRecord& record) {
  static const Reflectance none{};
  return {none, record, kGuidedProbabilities};
}

}  // namespace

Rgb emissionLeftToNee(const RenderScene& scene, const Receiver& receiver, const Ray& ray) {
  const float cosine = receiver.cosine(ray.direction);
  const TransmittedRay end = scene.follow(ray, scene.shadowSurfaces);
  const auto left = [&](float emitterPdf) { return Rgb(end.transmittance * (1 - directFraction(cosine, emitterPdf))); };
  const LightSelection nextEvent = scene.lights.at(LightReceiver{receiver.point.position, receiver.normal});
  if (!end.hit)
    return left(nextEvent.environmentPdf(ray.direction)) * scene.lights.environmentRadiance(end.last.direction);
  if (!end.hit->emitter || end.bent) return Rgb::Zero();
  return left(nextEvent.pdf(*end.hit)) * emittedRadiance(*end.hit);
}

std::vector<Receiver> receiversOfPaths(const RenderScene& scene, const RayCamera& camera, int count,
                                       std::uint64_t seed) {
  std::vector<Receiver> chosen;
  PathStatistics statistics;
  const PathOptions options{kReceiverDepth, kReceiverDepth, nullptr, scene.scene.emitterVisibility};
  for (int i = 0; i < count; ++i) {
    Sampler rng(seed, 0, i);
    const Vec2 pixel = rng.uniform2();
    const Ray ray = camera.sample(static_cast<int>(pixel.x() * static_cast<float>(camera.width())),
                                  static_cast<int>(pixel.y() * static_cast<float>(camera.height())), rng);
    std::vector<Receiver> vertices;
    const CollectingSampler sampler{vertices};
    PathLoop(scene, options, sampler).radiance(ray, rng, statistics);
    if (vertices.empty()) continue;
    chosen.push_back(vertices[static_cast<std::size_t>(rng.uniform() * static_cast<float>(vertices.size()))]);
  }
  return chosen;
}

std::optional<Receiver> firstReceiver(const RenderScene& scene, Ray ray) {
  constexpr int maxSurfaces = 64;
  for (int i = 0; i < maxSurfaces; ++i) {
    const std::optional<SurfaceHit> hit = i == 0 ? scene.firstVisible(ray) : scene.tracer.trace(ray);
    if (!hit || !hit->bsdf) return std::nullopt;
    if (hit->bsdf->deltaProbability(hit->wo, hit->uv) < 1) return receiverOf(*hit);
    const std::optional<DeltaSample> sample = sampleDelta(*hit, 0.5f);
    if (!sample) return std::nullopt;
    ray = spawnRay(*hit, hit->frame.toWorld(sample->wi).normalized());
  }
  return std::nullopt;
}

ServedDensity::ServedDensity(const IlluminationCache& cache, const Receiver& receiver)
    : record_(cache.find(receiver.point.position, receiver.normal)),
      frame_(record_ ? Frame::fromTangent(receiver.normal, record_->tangent()) : Frame::fromNormal(receiver.normal)) {}

float ServedDensity::mixture(const Vec3& wi) const {
  const Vec3 local = frame_.toLocal(wi);
  return record_ ? guidedDensity(*record_).guidedPdf(local) / kGuidedProbabilities.illumination
                 : cosineHemispherePdf(local);
}

float ServedDensity::defensive(const Vec3& wi) const {
  return kGuidedProbabilities.illumination * mixture(wi) +
         kGuidedProbabilities.bsdf * cosineHemispherePdf(frame_.toLocal(wi));
}

std::optional<Vec3> ServedDensity::sample(float choice, const Vec2& u) const {
  const std::optional<Vec3> local = record_ ? guidedDensity(*record_).sample(Strategy::illumination, choice, u)
                                            : std::optional(squareToCosineHemisphere(u));
  if (!local) return std::nullopt;
  return frame_.toWorld(*local).normalized();
}

namespace {

/// Samples directions and estimates the radiance along them.
class DirectionSampler {
 public:
  DirectionSampler(const RenderScene& scene, const Integrator& paths, const Receiver& receiver,
                   const ServedDensity& near, const IncidentRadianceOptions& options, std::uint64_t stream)
      : scene_(scene), paths_(paths), receiver_(receiver), near_(near), options_(options), rng_(options.seed, stream) {}

  std::vector<IncidentRadiance::Sample> run() {
    overDisc();
    for (int i = 0; i < options_.mixture; ++i) {
      const float choice = rng_.uniform();
      if (const std::optional<Vec3> wi = near_.sample(choice, rng_.uniform2())) addSample(*wi, i % 2 == 0);
    }
    if (environment())
      for (int i = 0; i < options_.environment; ++i)
        if (const auto sample = environment()->sample(rng_.uniform2())) addSample(sample->wi, i % 2 == 0);
    return std::move(samples_);
  }

 private:
  const EnvironmentLight* environment() const { return scene_.lights.environment(); }

  /// Stratified over the square around the disc; samples in its corners are discarded.
  void overDisc() {
    const float side = 2.0f / static_cast<float>(options_.cells);
    for (int row = 0; row < options_.cells; ++row)
      for (int column = 0; column < options_.cells; ++column)
        for (int i = 0; i < options_.perCell; ++i) {
          const Vec2 jitter = rng_.uniform2();
          const Vec2 cell(static_cast<float>(column), static_cast<float>(row));
          const Vec2 y = Vec2::Constant(-1) + side * (cell + jitter);
          if (insideDisc(y)) addSample(near_.frame().toWorld(fromDisc(y)).normalized(), i % 2 == 0);
        }
  }

  double density(const Vec3& wi) const {
    constexpr double uniform = 1.0 / 8;  // ¼ over the square, dω = 2 dA
    double sum = uniform * options_.cells * options_.cells * options_.perCell + options_.mixture * near_.mixture(wi);
    if (environment()) sum += options_.environment * environment()->pdf(wi);
    return sum;
  }

  void addSample(const Vec3& wi, bool firstHalf) {
    const float cosine = receiver_.cosine(wi);
    if (!(cosine > 0)) return;
    const Ray ray = spawnRay(receiver_.point, wi);
    const Rgb leftToNee = emissionLeftToNee(scene_, receiver_, ray);
    const double first = estimate(ray, leftToNee), second = estimate(ray, leftToNee);
    samples_.push_back({wi, density(wi), cosine * first, cosine * second, firstHalf});
  }

  double estimate(const Ray& ray, const Rgb& leftToNee) {
    const float light = luminance(Rgb(paths_.radiance(ray, rng_, statistics_) - leftToNee));
    return std::isfinite(light) ? std::max(0.0f, light) : 0.0;
  }

  const RenderScene& scene_;
  const Integrator& paths_;
  const Receiver& receiver_;
  const ServedDensity& near_;
  const IncidentRadianceOptions& options_;
  PathStatistics statistics_;
  Sampler rng_;
  std::vector<IncidentRadiance::Sample> samples_;
};

}  // namespace

IncidentRadiance::IncidentRadiance(const RenderScene& scene, const Integrator& paths, const Receiver& receiver,
                                   const ServedDensity& near, const IncidentRadianceOptions& options,
                                   std::uint64_t stream)
    : samples_(DirectionSampler(scene, paths, receiver, near, options, stream).run()) {}

double IncidentRadiance::irradiance() const {
  double sum = 0;
  for (const Sample& s : samples_) sum += 0.5 * (s.first + s.second) / s.density;
  return sum;
}

std::optional<double> IncidentRadiance::nev(const std::function<double(const Vec3&)>& pdf) const {
  double square = 0;
  std::array<double, 2> halves{};
  for (const Sample& s : samples_) {
    // Each half has half of the directions, so its samples have twice the weight.
    halves[s.firstHalf ? 0 : 1] += (s.first + s.second) / s.density;
    const double product = s.first * s.second;
    if (product > 0) square += product / (s.density * pdf(s.wi));
  }
  const double mean2 = halves[0] * halves[1];
  if (!(mean2 > 0)) return std::nullopt;
  return square / mean2 - 1;
}

std::vector<Particle> particlesAround(const Receiver& receiver, std::span<const Particle> particles, std::size_t count,
                                      float maxDistance) {
  const auto distance2 = [&](const Particle& p) { return (p.position - receiver.point.position).squaredNorm(); };
  std::vector<Particle> found;
  std::ranges::copy_if(particles, std::back_inserter(found), [&](const Particle& p) {
    return distance2(p) <= maxDistance * maxDistance && p.normal.dot(receiver.normal) >= kMinNormalCosine &&
           receiver.cosine(p.direction) > 0;
  });
  if (found.size() <= count) return found;
  std::ranges::nth_element(found, found.begin() + static_cast<std::ptrdiff_t>(count), {}, distance2);
  found.resize(count);
  return found;
}

std::optional<double> meanLogDensity(std::span<const Particle> particles,
                                     const std::function<double(const Vec3&)>& pdf) {
  double sum = 0, weight = 0;
  for (const Particle& p : particles) {
    if (!(p.weight > 0)) continue;
    sum += p.weight * std::log(2 * pdf(p.direction));
    weight += p.weight;
  }
  if (!(weight > 0)) return std::nullopt;
  return sum / weight;
}

}  // namespace lobe
