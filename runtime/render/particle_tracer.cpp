#include "runtime/render/particle_tracer.h"

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

constexpr int kChunk = 1024;

/// Runs trace(rng, result) `count` times in chunks that any thread may take; the results come in order.
template <class Result, class Trace>
std::vector<Result> traceChunks(std::uint64_t seed, std::uint64_t stream, int count, const Trace& trace) {
  const int chunks = (count + kChunk - 1) / kChunk;
  std::vector<Result> results(chunks);
  parallelFor(0, chunks, [&](int chunk) {
    for (int i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      Rng rng(seed, stream, i);
      trace(rng, results[chunk]);
    }
  });
  return results;
}

/// One part of all results, put together in order.
template <class Result, class T>
std::vector<T> joined(const std::vector<Result>& results, std::vector<T> Result::*part) {
  std::size_t size = 0;
  for (const Result& r : results) size += (r.*part).size();
  std::vector<T> all;
  all.reserve(size);
  for (const Result& r : results) all.insert(all.end(), (r.*part).begin(), (r.*part).end());
  return all;
}

}  // namespace

ParticleTracer::ParticleTracer(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& radiance,
                               const GuidedSampler& importance, const EnvironmentGuide* guide, std::uint64_t seed)
    : scene_(scene), camera_(camera), radiance_(radiance), importance_(importance), guide_(guide), seed_(seed) {}

ImportonResult ParticleTracer::traceImportons(int pass, int count, const ImportonWishes& wishes) const {
  const auto results = traceChunks<ImportonResult>(
      seed_, 2 * static_cast<std::uint64_t>(pass), count, [&](Rng& rng, ImportonResult& result) {
        const Vec2 pixel = rng.uniform2();
        const int x = static_cast<int>(pixel.x() * static_cast<float>(camera_.width()));
        const int y = static_cast<int>(pixel.y() * static_cast<float>(camera_.height()));
        const Ray ray = camera_.sample(x, y, rng);
        ImportonWalk(scene_, radiance_, wishes, rng, result).run(ray);
      });
  return {joined(results, &ImportonResult::requests), joined(results, &ImportonResult::uses),
          joined(results, &ImportonResult::importance), joined(results, &ImportonResult::samples),
          joined(results, &ImportonResult::shares)};
}

PhotonResult ParticleTracer::tracePhotons(int pass, int count) const {
  if (scene_.lights.empty()) return {};
  const auto results = traceChunks<PhotonResult>(seed_, 2 * static_cast<std::uint64_t>(pass) + 1, count,
                                                 [&](Rng& rng, PhotonResult& result) {
                                                   if (const std::optional<EmittedPhoton> photon = emit(rng))
                                                     PhotonWalk(scene_, importance_, rng, result).run(*photon);
                                                 });
  return {joined(results, &PhotonResult::particles), joined(results, &PhotonResult::requests)};
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

}  // namespace lobe
