#include "runtime/render/training/visible_region.h"

#include <algorithm>
#include <vector>

#include "runtime/core/parallel.h"
#include "runtime/render/training/camera_walk.h"

namespace lobe {
namespace {

// Keeps the random numbers apart from those of training and rendering with the same seed.
constexpr std::uint64_t kTag = 0x726567696f6e3031;

constexpr int kPaths = 4096, kChunk = 256;
constexpr std::size_t kLeastVertices = 64;
// The fraction of the vertices that may be beyond each side of the box before it is enlarged: the few that are seen
// through a window, for example, on the ground up to the horizon.
constexpr double kOutside = 0.025;
constexpr float kEnlargement = 0.25f;  // at each side, relative to the extent

std::vector<Vec3> verticesOf(const RenderScene& scene, const RayCamera& camera, std::uint64_t seed, int maxDepth) {
  std::vector<std::vector<Vec3>> parts(kPaths / kChunk);
  parallelFor(0, kPaths / kChunk, [&](int chunk) {
    for (int i = chunk * kChunk; i < (chunk + 1) * kChunk; ++i) {
      Sampler rng(seed ^ kTag, 0, i);
      walkFromCamera(scene, camera, maxDepth, rng,
                     [&](const SurfaceHit& hit, float) { parts[chunk].push_back(hit.position); });
    }
  });
  std::vector<Vec3> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

/// The order statistic of one coordinate.
float coordinateAt(std::vector<Vec3>& points, int axis, std::size_t rank) {
  const auto at = points.begin() + static_cast<std::ptrdiff_t>(rank);
  std::ranges::nth_element(points, at, {}, [axis](const Vec3& p) { return p[axis]; });
  return (*at)[axis];
}

}  // namespace

Eigen::AlignedBox3f visibleRegion(const RenderScene& scene, const RayCamera& camera, std::uint64_t seed, int maxDepth) {
  const Eigen::AlignedBox3f& bounds = scene.tracer.bounds();
  std::vector<Vec3> vertices = verticesOf(scene, camera, seed, maxDepth);
  if (vertices.size() < kLeastVertices) return bounds;
  const auto outside = static_cast<std::size_t>(kOutside * static_cast<double>(vertices.size()));
  Vec3 low, high;
  for (int axis = 0; axis < 3; ++axis) {
    low[axis] = coordinateAt(vertices, axis, outside);
    high[axis] = coordinateAt(vertices, axis, vertices.size() - 1 - outside);
  }
  const Vec3 margin = kEnlargement * (high - low);
  const Eigen::AlignedBox3f region = Eigen::AlignedBox3f(low - margin, high + margin).intersection(bounds);
  return region.diagonal().norm() > 0 ? region : bounds;
}

}  // namespace lobe
