#include "runtime/render/integrators/learn_sample_counts.h"

#include <algorithm>

#include "runtime/core/parallel.h"

namespace lobe {

SampleCountModel learnSampleCounts(const RenderScene& scene, const RayCamera& camera, const PathOptions& options,
                                   const GuidedSampler& guide, std::size_t records, int paths, std::uint64_t seed) {
  // Keeps the random numbers apart from those of training and of rendering with the same seed.
  constexpr std::uint64_t kTag = 0x73616d706c657321;
  constexpr int kChunk = 1024;
  PathOptions plain = options;
  plain.counts = nullptr;
  const PathLoop loop(scene, plain, guide);
  std::vector<PathLog> logs((paths + kChunk - 1) / kChunk);
  parallelFor(std::size_t{0}, logs.size(), [&](std::size_t chunk) {
    const int first = static_cast<int>(chunk) * kChunk;
    for (int i = first; i < std::min(paths, first + kChunk); ++i) {
      Sampler rng(seed ^ kTag, 0, i);
      const Vec2 pixel = rng.uniform2();
      const int x = static_cast<int>(pixel.x() * static_cast<float>(camera.width()));
      const int y = static_cast<int>(pixel.y() * static_cast<float>(camera.height()));
      const Ray ray = camera.sample(x, y, rng);
      loop.log(ray, rng, logs[chunk]);
    }
  });
  PathLog all;
  for (const PathLog& log : logs) all.append(log);
  return {all, records};
}

}  // namespace lobe
