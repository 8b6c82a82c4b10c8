#include "runtime/render/particle_tracer.h"

#include <algorithm>

#include <oneapi/tbb/parallel_for.h>

namespace lobe {
namespace {

constexpr int kChunk = 1024;
// Training needs no path to be complete: light that has bounced this often is spread out.
constexpr int kMaxDepth = 32;

/// Runs trace(rng, result) `count` times in chunks that any thread may take, and hands the results on in order.
template <class Result, class Trace, class Collect>
void traceChunks(std::uint64_t seed, std::uint64_t stream, int count, const Trace& trace, const Collect& collect) {
  const int chunks = (count + kChunk - 1) / kChunk;
  std::vector<Result> results(chunks);
  oneapi::tbb::parallel_for(0, chunks, [&](int chunk) {
    for (int i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      Rng rng(seed, stream, i);
      trace(rng, results[chunk]);
    }
  });
  for (Result& result : results) collect(result);
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// A particle between two surfaces.
struct Flight {
  Ray ray;
  Rgb weight;
};

/// Ends the flight by chance in proportion to what scattering took from it, so that weights stay alike.
bool survives(Flight& flight, const Rgb& scattered, Rng& rng) {
  const float before = luminance(flight.weight), after = luminance(scattered);
  if (!(after > 0) || !std::isfinite(after)) return false;
  const float survival = std::min(1.0f, after / before);
  if (rng.uniform() >= survival) return false;
  flight.weight = scattered / survival;
  return true;
}

/// A scattered direction with f·cos over its density; for photons the directions change roles.
struct Scattered {
  Vec3 wi;
  Rgb weight;
  float pdf;  ///< 0 for the delta part
};

template <class SampleSmooth>
std::optional<Scattered> scatter(const SurfaceHit& hit, Rng& rng, bool importance, const SampleSmooth& sampleSmooth) {
  // Refraction scales radiance, not flux.
  const auto fluxScale = [&](float eta) { return importance ? eta * eta : 1.0f; };
  const float delta = hit.bsdf->deltaProbability(hit.wo, hit.uv);
  if (delta > 0 && rng.uniform() < delta) {
    const std::optional<DeltaSample> sample = hit.bsdf->sampleDelta(hit.wo, hit.uv, rng.uniform());
    if (!sample) return std::nullopt;
    return Scattered{sample->wi, sample->weight * (fluxScale(sample->eta) / delta), 0};
  }
  const std::optional<BsdfSample> sample = sampleSmooth();
  if (!sample) return std::nullopt;
  const float pdf = (1 - delta) * sample->pdf;
  return Scattered{sample->wi, sample->f * (fluxScale(sample->eta) * std::abs(sample->wi.z()) / pdf), pdf};
}

bool leave(const SurfaceHit& hit, const Scattered& scattered, Flight& flight, Rng& rng) {
  const Vec3 direction = hit.frame.toWorld(scattered.wi).normalized();
  if (!sidesAgree(hit, direction, scattered.wi)) return false;
  if (!survives(flight, flight.weight * scattered.weight, rng)) return false;
  flight.ray = spawnRay(hit, direction);
  return true;
}

/// How light from infinitely far reaches a point.
enum class Passage { blocked, free, refracted };

/// Follows the direction through surfaces that only refract, as if they did not bend it: exact for panes, and near
/// enough to learn where photons should start.
Passage passageToEnvironment(const RayTracer& tracer, const SurfacePoint& from, const Vec3& direction) {
  constexpr int maxSurfaces = 16;
  Passage passage = Passage::free;
  Ray ray = spawnRay(from, direction);
  for (int i = 0; i < maxSurfaces; ++i) {
    const std::optional<SurfaceHit> hit = tracer.trace(ray);
    if (!hit) return passage;
    if (!hit->bsdf || !hit->bsdf->transmits() || hit->bsdf->deltaProbability(hit->wo, hit->uv) <= 0)
      return Passage::blocked;
    passage = Passage::refracted;
    ray = spawnRay(*hit, direction);
  }
  return Passage::blocked;
}

Vec3 normalTowards(const SurfaceHit& hit) {
  return std::copysign(1.0f, hit.normal.dot(hit.woWorld)) * hit.normal;
}

/// What BSDF sampling is left with where emitter sampling finds the same light (nothing of a delta light's); a cosine
/// stands for the density to come.
float directShare(const EmittedPhoton& photon, const SurfaceHit& hit) {
  const float cosine = std::abs(hit.normal.dot(hit.woWorld));
  float emitter = photon.emitterDensity;
  if (!photon.far) {
    const float cosineAtLight = std::abs(photon.normal.dot(photon.ray.direction));
    emitter *= hit.distance * hit.distance / std::max(cosineAtLight, 1e-6f);
  }
  return misWeight(std::max(cosine * kInvPi, 1e-6f), emitter);
}

}  // namespace

ParticleTracer::ParticleTracer(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& sampler,
                               const EnvironmentGuide* guide, std::uint64_t seed)
    : scene_(scene), camera_(camera), sampler_(sampler), guide_(guide), seed_(seed) {}

ImportonResult ParticleTracer::traceImportons(int pass, int count) const {
  ImportonResult all;
  traceChunks<ImportonResult>(
      seed_, 2 * static_cast<std::uint64_t>(pass), count, [&](Rng& rng, ImportonResult& r) { traceImporton(rng, r); },
      [&](const ImportonResult& r) {
        append(all.requests, r.requests);
        append(all.uses, r.uses);
      });
  return all;
}

std::vector<Particle> ParticleTracer::tracePhotons(int pass, int count) const {
  std::vector<Particle> all;
  if (scene_.lights.empty()) return all;
  traceChunks<std::vector<Particle>>(
      seed_, 2 * static_cast<std::uint64_t>(pass) + 1, count,
      [&](Rng& rng, std::vector<Particle>& p) { tracePhoton(rng, p); },
      [&](const std::vector<Particle>& p) { append(all, p); });
  return all;
}

void ParticleTracer::traceImporton(Rng& rng, ImportonResult& result) const {
  const Vec2 pixel = rng.uniform2();
  const int x = static_cast<int>(pixel.x() * static_cast<float>(camera_.width()));
  const int y = static_cast<int>(pixel.y() * static_cast<float>(camera_.height()));
  Flight flight{camera_.sample(x, y, rng), Rgb::Ones()};
  float pdf = 0;
  PathStatistics ignored;
  for (int depth = 1; depth <= kMaxDepth; ++depth) {
    const std::optional<SurfaceHit> hit = scene_.tracer.trace(flight.ray);
    if (!hit) {
      // Light that the camera sees directly, or by mirrors only, needs no photons; that of first surfaces is shared
      // with emitter sampling.
      const Vec3& wi = flight.ray.direction;
      if (!guide_ || depth == 1) return;
      const float share = pdf > 0 ? misWeight(pdf, scene_.lights.environmentPdf(wi)) : 1.0f;
      const float weight = share * luminance(flight.weight * scene_.lights.environmentRadiance(wi));
      if (weight > 0 && std::isfinite(weight)) result.uses.push_back({flight.ray.origin, wi, weight});
      return;
    }
    if (!hit->bsdf || !sidesAgree(*hit, hit->woWorld, hit->wo)) return;
    std::optional<GuidedSampler::Vertex> vertex;
    if (hit->bsdf->deltaProbability(hit->wo, hit->uv) < 1) {
      vertex.emplace(sampler_, *hit);
      if (!vertex->guided()) result.requests.push_back({hit->position, normalTowards(*hit)});
      if (guide_) addDirectUse(*hit, *vertex, flight.weight, depth, rng, result);
    }
    const auto scattered = scatter(*hit, rng, false, [&] { return vertex->sample(rng, ignored); });
    if (!scattered || !leave(*hit, *scattered, flight, rng)) return;
    pdf = scattered->pdf;
  }
}

void ParticleTracer::addDirectUse(const SurfaceHit& hit, const GuidedSampler::Vertex& vertex, const Rgb& throughput,
                                  int depth, Rng& rng, ImportonResult& result) const {
  const float choice = rng.uniform();
  const std::optional<LightSample> light = scene_.lights.sample(hit.position, choice, rng.uniform2());
  if (!light || light->source || light->delta) return;
  const Vec3 wi = hit.frame.toLocal(light->wi);
  if (!sidesAgree(hit, light->wi, wi)) return;
  const Rgb value = throughput * hit.bsdf->eval(hit.wo, wi, hit.uv) * light->radiance;
  float weight = luminance(value) * std::abs(wi.z()) / light->pdf;
  if (!(weight > 0) || !std::isfinite(weight)) return;
  const Passage passage = passageToEnvironment(scene_.tracer, hit, light->wi);
  // What reaches the first surface freely is the renderer's own emitter sampling's work.
  if (passage == Passage::blocked || (passage == Passage::free && depth == 1)) return;
  if (passage == Passage::free) weight *= misWeight(light->pdf, vertex.pdf(wi));
  result.uses.push_back({hit.position, light->wi, weight});
}

std::optional<EmittedPhoton> ParticleTracer::emit(Rng& rng) const {
  const float environment = guide_ ? scene_.lights.environmentProbability() : 0.0f;
  const float choice = rng.uniform();
  const Vec2 u1 = rng.uniform2();
  const Vec2 u2 = rng.uniform2();
  // The environment is the last light: choices below 1 − environment mean surfaces.
  if (choice < 1 - environment) return scene_.lights.samplePhoton(choice, u1, u2);
  std::optional<EmittedPhoton> photon = guide_->sample((choice - (1 - environment)) / environment, u1, u2);
  if (photon) photon->power /= environment;
  return photon;
}

void ParticleTracer::tracePhoton(Rng& rng, std::vector<Particle>& particles) const {
  const std::optional<EmittedPhoton> photon = emit(rng);
  if (!photon) return;
  Flight flight{photon->ray, photon->power};
  for (int depth = 1; depth <= kMaxDepth; ++depth) {
    const std::optional<SurfaceHit> hit = scene_.tracer.trace(flight.ray);
    if (!hit || !hit->bsdf || !sidesAgree(*hit, hit->woWorld, hit->wo)) return;
    if (hit->bsdf->deltaProbability(hit->wo, hit->uv) < 1) {
      const bool far = depth == 1 && photon->far;
      const float weight = luminance(flight.weight) * (depth == 1 ? directShare(*photon, *hit) : 1.0f);
      if (weight > 0 && std::isfinite(weight))
        particles.push_back(
            {hit->position, normalTowards(*hit), hit->woWorld, weight, far ? kInfinity : hit->distance});
    }
    const auto scattered = scatter(*hit, rng, true, [&] {
      const float choice = rng.uniform();
      return hit->bsdf->sample(hit->wo, hit->uv, choice, rng.uniform2());
    });
    if (!scattered || !leave(*hit, *scattered, flight, rng)) return;
  }
}

}  // namespace lobe
