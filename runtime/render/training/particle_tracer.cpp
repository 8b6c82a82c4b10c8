#include "runtime/render/training/particle_tracer.h"

#include "runtime/core/parallel.h"
#include "runtime/render/training/camera_walk.h"

namespace lobe {
namespace {

// Keeps the random numbers of training apart from those of rendering with the same seed.
constexpr std::uint64_t kTrainingSeed = 0x747261696e696e67;

constexpr int kChunk = 256;
// Path numbers of photons follow those of importons.
constexpr std::uint64_t kFirstPhoton = std::uint64_t{1} << 32;

/// Runs trace(i, rng, result) for all i < count in parallel chunks; the results are in order.
template <class Result, class Trace>
std::vector<Result> traceChunks(std::uint64_t seed, std::uint64_t stream, int count, const Trace& trace) {
  const int chunks = (count + kChunk - 1) / kChunk;
  std::vector<Result> results(chunks);
  parallelFor(0, chunks, [&](int chunk) {
    for (int i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
      Sampler rng(seed, stream, i);
      trace(i, rng, results[chunk]);
    }
  });
  return results;
}

/// The content of one storage of all results, in their order.
template <class Result>
SampleStorage merged(std::vector<Result>& results, SampleStorage Result::*storage) {
  std::vector<SampleStorage> parts;
  parts.reserve(results.size());
  for (Result& result : results) parts.push_back(std::move(result.*storage));
  SampleStorage all;
  all.merge(parts);
  return all;
}

}  // namespace

ParticleTracer::ParticleTracer(const RenderScene& scene, const RayCamera& camera, const GuidedSampler& radiance,
                               const GuidedSampler& importance, const EnvironmentGuide* guide, std::uint64_t seed,
                               int maxDepth)
    : scene_(scene),
      camera_(camera),
      radiance_(radiance),
      importance_(importance),
      emission_(scene.lights, guide),
      seed_(seed ^ kTrainingSeed),
      maxDepth_(maxDepth) {}

ImportonResult ParticleTracer::traceImportons(int pass, int count, const ImportonWishes& wishes) const {
  auto results = traceChunks<ImportonResult>(
      seed_, 2 * static_cast<std::uint64_t>(pass), count, [&](int i, Sampler& rng, ImportonResult& result) {
        const Ray ray = sampleCameraRay(camera_, rng);
        ImportonWalk(scene_, radiance_, wishes, rng, result, maxDepth_).run(ray, static_cast<std::uint64_t>(i));
      });
  ImportonResult all{merged(results, &ImportonResult::radiance), merged(results, &ImportonResult::importance), {}};
  for (const ImportonResult& result : results) all.uses.insert(all.uses.end(), result.uses.begin(), result.uses.end());
  return all;
}

PhotonResult ParticleTracer::tracePhotons(int pass, int count) const {
  if (scene_.lights.empty()) return {};
  auto results = traceChunks<PhotonResult>(seed_, 2 * static_cast<std::uint64_t>(pass) + 1, count,
                                           [&](int i, Sampler& rng, PhotonResult& result) {
                                             if (const std::optional<EmittedPhoton> photon = emit(rng))
                                               PhotonWalk(scene_, importance_, rng, result, maxDepth_)
                                                   .run(*photon, kFirstPhoton + static_cast<std::uint64_t>(i), count);
                                           });
  return {merged(results, &PhotonResult::radiance), merged(results, &PhotonResult::importance)};
}

std::optional<EmittedPhoton> ParticleTracer::emit(Sampler& rng) const {
  const double choice = rng.uniformDouble();
  const Vec2 u1 = rng.uniform2();
  return emission_.sample(choice, u1, rng.uniform2());
}

}  // namespace lobe
